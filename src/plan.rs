//! What a scene and a method need, and so what is left out: decided once, before rendering, with the reasons.

use crate::film::Needs;
use crate::scene::Scene;

/// Something that may be computed, and why it is or is not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// What.
    pub what: &'static str,
    /// Whether it is computed.
    pub computed: bool,
    /// Why.
    pub reason: String,
}

/// What will be rendered.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What the film records.
    pub needs: Needs,
    /// All decisions.
    pub items: Vec<Item>,
    dark: bool,
}

impl Plan {
    /// Decides for a method's needs and what is to be saved besides.
    pub fn new(scene: &Scene, method: Needs, saved: Needs) -> Self {
        let wanted = method.union(saved);
        let dark = edges_differ(scene).is_err();
        let needs = Needs { edges: wanted.edges && !dark, ..wanted };
        let mut items = of_film(scene, method, saved, needs);
        items.extend(of_scene(scene, needs));
        Self { needs, items, dark }
    }

    /// Leaves nothing out, for comparison: the scene is to be [generalized](Scene::generalize) as well.
    pub fn all(scene: &Scene) -> Self {
        let mut plan = Self::new(scene, Needs::ALL, Needs::default());
        for item in &mut plan.items {
            (item.computed, item.reason) = (true, "everything is asked for".to_owned());
        }
        Self { needs: Needs::ALL, ..plan }
    }

    /// Whether there is no scattered light, so that differences are not rendered since they are known to be zero.
    pub fn is_dark(&self) -> bool {
        self.dark
    }

    /// One line: `+gradients -features -bins`.
    pub fn summary(&self) -> String {
        let sign = |item: &Item| if item.computed { '+' } else { '-' };
        self.items.iter().map(|item| format!("{}{}", sign(item), item.what)).collect::<Vec<_>>().join(" ")
    }
}

/// Whether neighbouring pixels can differ in light that is scattered; why not, else.
fn edges_differ(scene: &Scene) -> Result<(), &'static str> {
    if scene.emitters().is_empty() {
        return Err("nothing in the scene emits light");
    }
    match scene.integrator().max_depth {
        0 | 1 => Err("the path depth leaves only emitters seen directly"),
        _ => Ok(()),
    }
}

/// What the film records.
fn of_film(scene: &Scene, method: Needs, saved: Needs, needs: Needs) -> Vec<Item> {
    let item = |what, computed, by_method: bool, by_saving: bool| {
        let reason = match (by_method, by_saving) {
            (true, _) => "the method needs them",
            (_, true) => "they are to be saved",
            _ => "neither the method nor the saved layers need them",
        };
        Item { what, computed, reason: reason.to_owned() }
    };
    let mut gradients = item("gradients", needs.edges, method.edges, saved.edges);
    if let (true, Err(reason)) = (method.edges || saved.edges, edges_differ(scene)) {
        gradients.reason = reason.to_owned();
    }
    vec![
        gradients,
        item("features", needs.features, method.features, saved.features),
        item("bins", needs.bins, method.bins, saved.bins),
        item("occlusion", needs.occlusion, method.occlusion, saved.occlusion),
        item("position", needs.position, method.position, saved.position),
        item("ambient", needs.ambient, method.ambient, saved.ambient),
    ]
}

/// What tracing the scene takes.
fn of_scene(scene: &Scene, needs: Needs) -> Vec<Item> {
    let census = scene.census();
    let item = |what, computed, reason: String| Item { what, computed, reason };
    let of_shapes = |count: usize, what: &str| format!("{count} of {} shapes {what}", census.shapes);
    let (others, lens) = (census.shapes - census.diffuse, scene.sensor().has_lens());
    let half_vectors = match (needs.edges, others) {
        (false, _) => "without gradients no path is shifted".to_owned(),
        (_, 0) => "every material is diffuse: offsets always join their base paths".to_owned(),
        _ => of_shapes(others, "may have lobes that are no wider than a mirror's"),
    };
    let camera_rays = match (needs.edges, lens) {
        (false, _) => "without gradients there are no offsets",
        (_, true) => "pixels look from different points of the lens",
        _ => "through a pinhole offsets begin as their neighbours' own paths",
    };
    let hidden = scene.integrator().hide_emitters;
    vec![
        item("materials", others > 0, of_shapes(others, "have a material to be asked ray by ray")),
        item("textures", census.textured > 0, of_shapes(census.textured, "need texture coordinates")),
        item("derivatives", census.bent > 0, of_shapes(census.bent, "have a material that bends normals")),
        item(
            "emitters",
            census.glowing < census.emitters,
            format!("{} of {} emitters are meshes that glow evenly", census.glowing, census.emitters),
        ),
        item(
            "environment",
            scene.has_environment(),
            if scene.has_environment() { "light comes from all around" } else { "nothing surrounds the scene" }.into(),
        ),
        item("direct", !hidden, if hidden { "emitters are hidden" } else { "the camera may see emitters" }.into()),
        item("half-vectors", needs.edges && others > 0, half_vectors),
        item("offset-rays", needs.edges && lens, camera_rays.to_owned()),
    ]
}
