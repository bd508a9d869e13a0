//! The shift of a base path to a neighbouring pixel, and the difference of their contributions.

pub mod half_vector;
pub mod reconnect;
mod walk;

use serde::{Deserialize, Serialize};

pub use self::walk::{Room, Walk};
use crate::math::Rgb;

/// How the base path of a pixel becomes a path of its neighbour.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shift {
    /// Reconnection where both paths scatter diffusely, half-vector copies elsewhere.
    Reconnect {
        /// Roughness above which a smooth lobe counts as diffuse.
        threshold: f32,
    },
    /// The neighbour's path of the same random numbers.
    Replay,
}

/// The shifts by name, with what they do.
pub const SHIFTS: &[(&str, Shift, &str)] = &[
    ("reconnect", Shift::Reconnect { threshold: 0.001 }, "join the base path where it scatters diffusely"),
    ("replay", Shift::Replay, "trace the neighbour's path of the same random numbers; noisier, slower, never fails"),
];

impl Default for Shift {
    fn default() -> Self {
        let (_, shift, _) = SHIFTS[0];
        shift
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
