//! The sampled path of a pixel, recorded so that it can be shifted.

use crate::math::Rgb;
use crate::render::path::{Emission, Light, Recorder, Scatter};
use crate::scene::Surface;

/// A surface that the base path scatters at, with all that was sampled there.
pub struct Vertex {
    /// The surface.
    pub surface: Surface,
    /// f cos / pdf of everything before, with the chances of survival taken off.
    pub throughput: Rgb,
    /// Roughness of its smooth lobes, if it has any.
    pub roughness: Option<f32>,
    /// The emitter point that lights it.
    pub light: Option<Light>,
    /// Where the path goes on.
    pub scatter: Option<Scatter>,
    /// The emitter that the path meets next.
    pub emission: Option<Emission>,
}

/// The vertices from the camera on.
#[derive(Default)]
pub struct BasePath {
    /// In order.
    pub vertices: Vec<Vertex>,
}

impl BasePath {
    /// Makes room for the next path.
    pub fn clear(&mut self) {
        self.vertices.clear();
    }

    /// Whether the path carries no light. The other ends of its edges account for what its copies would carry.
    pub fn is_dark(&self) -> bool {
        self.vertices.iter().all(|vertex| vertex.light.is_none() && vertex.emission.is_none())
    }

    /// Number of leading vertices that light still reaches; later ones need not be shifted.
    pub fn lit_length(&self) -> usize {
        let lit = |vertex: &Vertex| vertex.light.is_some() || vertex.emission.is_some();
        self.vertices.iter().rposition(lit).map_or(0, |last| last + 1)
    }
}

impl Recorder for BasePath {
    fn vertex(&mut self, surface: &Surface, throughput: Rgb, roughness: Option<f32>) {
        let surface = *surface;
        self.vertices.push(Vertex { surface, throughput, roughness, light: None, scatter: None, emission: None });
    }

    fn light(&mut self, light: Light) {
        if let Some(vertex) = self.vertices.last_mut() {
            vertex.light = Some(light);
        }
    }

    fn scatter(&mut self, scatter: Scatter) {
        if let Some(vertex) = self.vertices.last_mut() {
            vertex.scatter = Some(scatter);
        }
    }

    fn emission(&mut self, emission: Emission) {
        if let Some(vertex) = self.vertices.last_mut() {
            vertex.emission = Some(emission);
        }
    }
}
