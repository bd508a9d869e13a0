//! Counts of a scene's shapes and emitters, by which the plan says what can be left out.

use super::Scene;
use super::emitter::Choice;

/// Counts of shapes and emitters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneStats {
    /// Number of shapes.
    pub shapes: usize,
    /// Shapes whose material is a diffuse lobe and nothing else.
    pub diffuse: usize,
    /// Shapes whose material packets evaluate.
    pub closing: usize,
    /// Shapes whose texture coordinates are used.
    pub textured: usize,
    /// Shapes whose material perturbs shading normals, which needs derivatives of the surface.
    pub perturbed: usize,
    /// Number of emitters.
    pub emitters: usize,
    /// Emitters that are meshes of uniform radiance.
    pub uniform_meshes: usize,
    /// Emitters and triangles in the tree of lights, none if it is left out.
    pub in_tree: usize,
}

impl Scene {
    /// Counts the scene's shapes and emitters.
    pub fn stats(&self) -> SceneStats {
        let count = |test: fn(&super::ShapeInfo) -> bool| self.shape_infos.iter().filter(|info| test(info)).count();
        SceneStats {
            shapes: self.shapes.len(),
            diffuse: count(|info| info.diffuse),
            closing: count(|info| info.closes),
            textured: count(|info| info.uv),
            perturbed: self.shapes.iter().filter(|shape| shape.bsdf.needs_derivatives()).count(),
            emitters: self.emitters.len(),
            uniform_meshes: self.emitter_infos.iter().filter(|info| info.mesh_light.is_some()).count(),
            in_tree: self.emitter_choice.as_ref().map_or(0, Choice::in_tree),
        }
    }
}
