//! Bounds of positions and directions.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use crate::math::Vec3;
use crate::scene::Bounds;

/// Bounds of an emitter's positions and directions of emission.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// The box around it.
    pub bounds: Bounds,
    /// Middle of its normals.
    pub axis: Vec3,
    /// Largest angle from there to a normal, at most π.
    pub spread: f32,
    /// Largest angle from a normal that it shines at.
    pub reach: f32,
}

impl Extent {
    /// Bounds of both.
    pub fn union(&self, other: &Self) -> Self {
        let (wide, narrow) = if self.spread >= other.spread { (self, other) } else { (other, self) };
        let apart = wide.axis.dot(narrow.axis).clamp(-1.0, 1.0).acos();
        let bounds = self.bounds.union(other.bounds);
        let reach = self.reach.max(other.reach);
        if apart + narrow.spread <= wide.spread {
            return Self { bounds, reach, ..*wide };
        }
        let spread = 0.5 * (wide.spread + apart + narrow.spread);
        let across = wide.axis.cross(narrow.axis).try_normalize();
        match across.filter(|_| spread < PI) {
            Some(across) => {
                let axis = glam::Quat::from_axis_angle(across, spread - wide.spread) * wide.axis;
                Self { bounds, axis, spread, reach }
            }
            None => Self { bounds, axis: wide.axis, spread: PI, reach },
        }
    }

    /// How much of all directions it may shine at (Conty Estevez and Kulla 2018).
    pub fn directions(&self) -> f32 {
        let (spread, end) = (self.spread, (self.spread + self.reach).min(PI));
        let (sin, cos) = spread.sin_cos();
        let rim = 2.0 * end * sin - (spread - 2.0 * end).cos() - 2.0 * spread * sin + cos;
        TAU * (1.0 - cos) + FRAC_PI_2 * rim
    }
}
