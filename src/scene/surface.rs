//! The point where a ray hits a shape.

use super::{Ray, texture};
use crate::math::{Frame, Vec3};

/// A surface point with its two normals and texture coordinates. Directions at a surface point away from it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position.
    pub p: Vec3,
    /// Geometric normal of length one, on the side of the shading normal.
    pub n: Vec3,
    /// Shading frame.
    pub frame: Frame,
    /// Texture coordinates.
    pub at: texture::Point,
    /// Number of the instance that the shape is in; `u32::MAX` if it is in none.
    pub instance: u32,
    /// Change of position along u. Zero unless the material asked for it.
    pub dp_du: Vec3,
    /// Change of position along v. Zero unless the material asked for it.
    pub dp_dv: Vec3,
    /// How far rays start off the surface, so that they do not meet it again.
    pub epsilon: f32,
    /// Radius of an exactly curved surface, positive where the normal points away from the centre; zero of others.
    pub curvature: f32,
    /// Direction back to where the ray came from, in the shading frame.
    pub wi: Vec3,
}

impl Default for Surface {
    /// A point of the plane z = 0 at the origin, seen from above.
    fn default() -> Self {
        let (zero, up) = (Vec3::ZERO, Vec3::Z);
        let frame = Frame { s: Vec3::X, t: Vec3::Y, n: up };
        Self {
            p: zero,
            n: up,
            frame,
            at: texture::Point::default(),
            instance: u32::MAX,
            dp_du: zero,
            dp_dv: zero,
            epsilon: 0.0,
            curvature: 0.0,
            wi: up,
        }
    }
}

/// Distance at which rays start off a surface, per size of coordinate. Far more than rounding asks for: scenes
/// are modelled with doubled and nearly coincident surfaces, and look right only in renderers that skip the
/// second one, as Mitsuba does at this distance.
pub const RAY_EPSILON: f32 = 1500.0 * 0.5 * f32::EPSILON;

/// How far off `p` rays start, in a scene of the given size. Where coordinates are small a length of one counts,
/// or the scene's own size when that is smaller.
pub fn epsilon(p: Vec3, scene_size: f32) -> f32 {
    RAY_EPSILON * (scene_size.min(1.0) + p.abs().max_element())
}

/// `p` moved off its surface to the side that `direction` leaves on.
#[inline]
pub fn offset(p: Vec3, n: Vec3, epsilon: f32, direction: Vec3) -> Vec3 {
    p + n * epsilon.copysign(n.dot(direction))
}

impl Surface {
    /// Origin of rays that leave along `direction`, of any length. Inside of a curved surface it is on the ray through the
    /// point itself: off it, light that is reflected again and again would meet the surface more and more steeply. Rays so
    /// grazing that they would start near their other end start as those of other surfaces.
    #[inline]
    pub fn leave(&self, direction: Vec3) -> Vec3 {
        let cosine = self.n.dot(direction);
        let room = cosine * cosine * self.curvature.abs();
        if cosine * self.curvature < 0.0 && room > 2.0 * self.epsilon * direction.length_squared() {
            return self.p + direction * (self.epsilon / cosine.abs());
        }
        offset(self.p, self.n, self.epsilon, direction)
    }

    /// The ray that leaves along the local direction `wo`.
    pub fn ray(&self, wo: Vec3) -> Ray {
        let direction = self.frame.to_world(wo).normalize();
        Ray::new(self.leave(direction), direction)
    }

    /// World to shading frame.
    pub fn to_local(&self, direction: Vec3) -> Vec3 {
        self.frame.to_local(direction)
    }
}
