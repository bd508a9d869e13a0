//! A point where a ray meets a shape.

use super::Ray;
use crate::math::{Frame, Vec2, Vec3};

/// A surface point with its two normals and what textures need. Directions at a surface point away from it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position.
    pub p: Vec3,
    /// Geometric normal of length one, on the side of the shading normal.
    pub n: Vec3,
    /// Shading frame.
    pub frame: Frame,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Change of position along u. Zero unless the material asked for it.
    pub dp_du: Vec3,
    /// Change of position along v. Zero unless the material asked for it.
    pub dp_dv: Vec3,
    /// How far rays start off the surface, so that they do not meet it again.
    pub epsilon: f32,
    /// Direction back to where the ray came from, in the shading frame.
    pub wi: Vec3,
    /// Number of the shape.
    pub instance: u32,
}

/// Starting distance per size of coordinate: eight units in the last place cover the rounding of the
/// interpolated position and of Embree's own intersection.
const OFFSET_ULPS: f32 = 8.0 * f32::EPSILON;

/// The offset for a surface element whose coordinates are at most `magnitude`.
pub fn epsilon(magnitude: f32) -> f32 {
    magnitude * OFFSET_ULPS
}

/// `p` moved off its surface to the side that `direction` leaves on.
#[inline]
pub fn offset(p: Vec3, n: Vec3, epsilon: f32, direction: Vec3) -> Vec3 {
    p + n * epsilon.copysign(n.dot(direction))
}

impl Surface {
    /// Where rays along `direction` start.
    #[inline]
    pub fn leave(&self, direction: Vec3) -> Vec3 {
        offset(self.p, self.n, self.epsilon, direction)
    }

    /// The ray that leaves along the local direction `wo`.
    pub fn ray(&self, wo: Vec3) -> Ray {
        let direction = self.frame.to_world(wo).normalize();
        Ray { origin: self.leave(direction), direction }
    }

    /// World to shading frame.
    pub fn to_local(&self, direction: Vec3) -> Vec3 {
        self.frame.to_local(direction)
    }
}
