//! Sixteen rays.

use crate::ffi::embree;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::scene::Ray;

/// Rays, coordinate by coordinate.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Rays {
    /// Origins.
    pub origin: Lanes3,
    /// Directions.
    pub direction: Lanes3,
    /// Lengths, in lengths of the direction.
    pub t_far: Lanes,
}

impl Rays {
    /// Rays of length zero, to be replaced.
    pub const NONE: Self = Self { origin: Lanes3::ZERO, direction: Lanes3::ZERO, t_far: Lanes::ZERO };

    /// The ray of one lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Ray {
        Ray { origin: self.origin.get(lane), direction: self.direction.get(lane), t_far: self.t_far.0[lane] }
    }

    /// Sets one lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, ray: Ray) {
        self.origin.set(lane, ray.origin);
        self.direction.set(lane, ray.direction);
        self.t_far.0[lane] = ray.t_far;
    }

    /// Copies one lane of other rays.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, from: &Self, lane: usize) {
        self.set(to, from.get(lane));
    }

    /// As Embree takes them.
    #[inline(always)]
    pub(in crate::scene) fn to_embree(self, active: Mask) -> embree::Rays {
        let (o, d) = (self.origin, self.direction);
        embree::Rays {
            origin: [o.x.0, o.y.0, o.z.0],
            direction: [d.x.0, d.y.0, d.z.0],
            t_far: self.t_far.0,
            active: active.0,
        }
    }
}
