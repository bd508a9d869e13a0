//! The plan: what a scene and a method need, and so what is left out. Decided once, before rendering, with the reasons.

use crate::film::{Asker, EdgeNeed, Needs, RECORDED, Recorded, RecordedInfo};
use crate::neighbours::Selector;
use crate::scene::Scene;

/// A decision: something that may be computed, and the reason why it is or is not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Name of the thing, as in `gradients`.
    pub name: &'static str,
    /// Whether it is computed.
    pub computed: bool,
    /// The reason.
    pub reason: String,
}

/// Everything that is decided before rendering.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Statistics that the film records.
    pub needs: Needs,
    /// All decisions.
    pub items: Vec<Item>,
}

impl Plan {
    /// Decides for the needs of a method and of the layers to be saved.
    pub fn new(scene: &Scene, method: Needs, saved: Needs) -> Self {
        let wanted = method.union(saved);
        let edges = match scatters_light(scene) {
            // Known at no cost, whether or not the method asks; those of the ambient light have to be sampled.
            Err(_) if !wanted.has(Recorded::Ambient) => EdgeNeed::KnownZero,
            // Bins of edges go with those of colours where every sample has both.
            _ if wanted.has(Recorded::Bins) => wanted.with_every_difference().edges,
            _ => wanted.edges,
        };
        let lights = scene.light_groups().count() as u8;
        let needs = Needs { edges, lights, ..wanted }.with_if(Recorded::Alpha, scene.sensor().wants_alpha());
        let mut items = of_film(scene, method, saved, needs);
        items.extend(of_scene(scene, needs));
        Self { needs, items }
    }

    /// Says by what neighbours are chosen, if they are.
    #[must_use]
    pub fn with_kernel(mut self, kernel: &Selector) -> Self {
        if !kernel.is_cross() {
            let reason = match (kernel.pilot(), kernel.without_differences()) {
                (0, _) => format!("the neighbours of {kernel} do not depend on the picture"),
                (spp, 0) => format!("{spp} samples decide the weights of {kernel}"),
                (spp, _) => format!("{spp} samples without differences choose the neighbours of {kernel}"),
            };
            self.items.push(Item { name: "pilot", computed: kernel.pilot() > 0, reason });
        }
        self
    }

    /// Leaves nothing out, for comparison; to be used with a scene without fast paths.
    pub fn all(scene: &Scene) -> Self {
        let mut plan = Self::new(scene, Needs::ALL, Needs::default());
        for item in &mut plan.items {
            (item.computed, item.reason) = (true, "everything is asked for".to_owned());
        }
        Self { needs: Needs { lights: plan.needs.lights, ..Needs::ALL }, ..plan }
    }

    /// One line: `+gradients -features -bins`.
    pub fn summary(&self) -> String {
        let sign = |item: &Item| if item.computed { '+' } else { '-' };
        self.items.iter().map(|item| format!("{}{}", sign(item), item.name)).collect::<Vec<_>>().join(" ")
    }
}

/// Whether any scattered light can reach the camera, or the reason why none can: then all differences are zero.
fn scatters_light(scene: &Scene) -> Result<(), &'static str> {
    if scene.emitters().is_empty() {
        return Err("nothing in the scene emits light");
    }
    match scene.integrator().max_depth {
        0 | 1 => Err("the path depth leaves only emitters seen directly"),
        _ => Ok(()),
    }
}

/// Decisions about the film.
fn of_film(scene: &Scene, method: Needs, saved: Needs, needs: Needs) -> Vec<Item> {
    let item = |name, computed, by_method: bool, by_saving: bool| {
        let reason = match (by_method, by_saving) {
            (true, _) => "the method needs them",
            (_, true) => "they are to be saved",
            _ => "neither the method nor the saved layers need them",
        };
        Item { name, computed, reason: reason.to_owned() }
    };
    let mut gradients = item("gradients", needs.edges.is_sampled(), method.edges.is_on(), saved.edges.is_on());
    if needs.edges == EdgeNeed::Thinned {
        gradients.reason += ", in fewer samples where they cost most";
    }
    let wanted = method.union(saved).edges.is_on();
    if let (true, false, Err(reason)) = (wanted, needs.edges.is_sampled(), scatters_light(scene)) {
        gradients.reason = reason.to_owned();
    }
    let of_row = |row: &RecordedInfo| match row.asker {
        Asker::Film(why, why_not) => {
            let computed = needs.has(row.id);
            Item { name: row.name, computed, reason: if computed { why } else { why_not }.to_owned() }
        }
        _ => item(row.name, needs.has(row.id), method.has(row.id), saved.has(row.id)),
    };
    let mut items = vec![gradients];
    items.extend(RECORDED.iter().map(of_row));
    items.push(Item {
        name: "lights",
        computed: needs.lights > 0,
        reason: match needs.lights {
            0 => "no light group is asked for".into(),
            count => format!("{count} light groups are recorded by themselves"),
        },
    });
    items
}

/// Decisions about the tracing of paths.
fn of_scene(scene: &Scene, needs: Needs) -> Vec<Item> {
    let stats = scene.stats();
    let item = |name, computed, reason: String| Item { name, computed, reason };
    let of_shapes = |count: usize, what: &str| format!("{count} of {} shapes {what}", stats.shapes);
    let single = stats.shapes - stats.closing;
    let (others, lens) = (stats.shapes - stats.diffuse, scene.sensor().has_lens());
    let half_vectors = match (needs.edges.is_sampled(), others) {
        (false, _) => "without gradients no path is shifted".to_owned(),
        (_, 0) => "every material is diffuse: offsets always join their base paths".to_owned(),
        _ => of_shapes(others, "may have lobes that are no wider than a mirror's"),
    };
    let camera_rays = match (needs.edges.is_sampled(), lens) {
        (false, _) => "without gradients there are no offsets",
        (_, true) => "pixels look from different points of the lens",
        _ => "through a pinhole offsets begin as their neighbours' own paths",
    };
    let light_tree = match stats.in_tree {
        0 => "emitters with a place are few: they are chosen by power".to_owned(),
        count => format!("{count} emitters and triangles are chosen by what they may send to a point"),
    };
    let hidden = scene.integrator().hide_emitters;
    vec![
        item("materials", single > 0, of_shapes(single, "have a material that is evaluated ray by ray")),
        item("textures", stats.textured > 0, of_shapes(stats.textured, "need texture coordinates")),
        item("derivatives", stats.perturbed > 0, of_shapes(stats.perturbed, "have a material that perturbs normals")),
        item(
            "emitters",
            stats.uniform_meshes < stats.emitters,
            format!("{} of {} emitters are meshes of uniform emission", stats.uniform_meshes, stats.emitters),
        ),
        item("light-tree", stats.in_tree > 0, light_tree),
        item(
            "environment",
            scene.has_environment(),
            if scene.has_environment() {
                "an environment emits light from all directions"
            } else {
                "there is no environment emitter"
            }
            .into(),
        ),
        item("direct", !hidden, if hidden { "emitters are hidden" } else { "the camera may see emitters" }.into()),
        item("half-vectors", needs.edges.is_sampled() && others > 0, half_vectors),
        item("offset-rays", needs.edges.is_sampled() && lens, camera_rays.to_owned()),
    ]
}
