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
}

impl Plan {
    /// Decides for a method's needs and what is to be saved besides.
    pub fn new(scene: &Scene, method: Needs, saved: Needs) -> Self {
        let lit = !scene.emitters().is_empty();
        let wanted = method.union(saved);
        let needs = Needs { edges: wanted.edges && lit && scene.integrator().max_depth > 1, ..wanted };
        let reason = |by_method: bool, by_saving: bool| match (by_method, by_saving) {
            (true, _) => "the method needs them".to_owned(),
            (_, true) => "they are to be saved".to_owned(),
            _ => "neither the method nor the saved layers need them".to_owned(),
        };
        let gradients = match (wanted.edges, needs.edges) {
            (true, false) if !lit => "nothing in the scene emits light".to_owned(),
            (true, false) => "the path depth leaves only emitters seen directly".to_owned(),
            _ => reason(method.edges, saved.edges),
        };
        let item = |what, computed, reason| Item { what, computed, reason };
        let items = vec![
            item("gradients", needs.edges, gradients),
            item("features", needs.features, reason(method.features, saved.features)),
            item("bins", needs.bins, reason(method.bins, saved.bins)),
            item("occlusion", needs.occlusion, reason(method.occlusion, saved.occlusion)),
            item("position", needs.position, reason(method.position, saved.position)),
            item("ambient", needs.ambient, reason(method.ambient, saved.ambient)),
        ];
        Self { needs, items }
    }

    /// One line: `+gradients -features -bins`.
    pub fn summary(&self) -> String {
        let sign = |item: &Item| if item.computed { '+' } else { '-' };
        self.items.iter().map(|item| format!("{}{}", sign(item), item.what)).collect::<Vec<_>>().join(" ")
    }
}
