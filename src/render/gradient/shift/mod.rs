//! The shift of a base path to a neighbouring pixel, and the difference of their contributions.

pub mod half_vector;
pub mod reconnect;
mod walk;

use self::walk::Walk;
use super::base_path::BasePath;
use crate::math::Rgb;
use crate::scene::{Ray, Scene};

/// Reconnection where both paths scatter diffusely, half-vector copies elsewhere.
#[derive(Clone, Copy, Debug)]
pub struct Shift {
    /// Roughness above which a smooth lobe counts as diffuse.
    pub threshold: f32,
}

impl Shift {
    /// This end's share of (neighbour - pixel): the sum of (J f(y) - f(x)) / D over the path's contributions.
    /// `ray` is the neighbour's camera ray.
    pub fn difference(&self, scene: &Scene, base: &BasePath, ray: Ray) -> Rgb {
        Walk::new(scene, self.threshold).along(&base.vertices[..base.lit_length()], ray)
    }
}

/// The offset's own last segment, to an emitter.
pub struct End {
    /// f cos at the offset's vertex.
    pub value: Rgb,
    /// Density per solid angle of scattering there, or probability of a delta lobe.
    pub pdf: f32,
    /// Density per solid angle of choosing the point from there; 0 after a delta lobe.
    pub light_pdf: f32,
    /// Radiance received.
    pub radiance: Rgb,
    /// dω' / dω.
    pub jacobian: f32,
}
