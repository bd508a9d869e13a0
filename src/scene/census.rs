//! What there is in a scene that work can be left out for.

use super::Scene;

/// Counts of shapes, each with its one material, and of emitters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// All shapes.
    pub shapes: usize,
    /// Those whose material is diffuse and nothing else.
    pub diffuse: usize,
    /// Those whose texture coordinates anybody looks at.
    pub textured: usize,
    /// Those whose material needs derivatives of the surface, as bump maps do.
    pub bent: usize,
    /// All emitters.
    pub emitters: usize,
    /// Those that are meshes glowing evenly.
    pub glowing: usize,
}

impl Scene {
    /// Counts what the scene is made of.
    pub fn census(&self) -> Census {
        let count = |test: fn(&super::Finish) -> bool| self.finishes.iter().filter(|finish| test(finish)).count();
        Census {
            shapes: self.shapes.len(),
            diffuse: count(|finish| finish.lambert),
            textured: count(|finish| finish.uv),
            bent: self.shapes.iter().filter(|shape| shape.bsdf.needs_derivatives()).count(),
            emitters: self.emitters.len(),
            glowing: self.lamps.iter().filter(|lamp| lamp.glow.is_some()).count(),
        }
    }

    /// Forgets what has been found out about shapes, so that every material is asked about every surface and everything is
    /// looked up that might be needed. Renders the same.
    pub fn generalize(&mut self) {
        for finish in &mut self.finishes {
            (finish.lambert, finish.uv) = (false, true);
        }
    }
}
