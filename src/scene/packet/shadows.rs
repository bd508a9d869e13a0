//! Shadow rays of many packets, few of each, gathered to full packets before they are traced.

use super::{Lights, Rays, Surfaces};
use crate::math::lanes::{LANES, Lanes, Mask};
use crate::scene::{Purpose, Scene, accel};

/// Shadow rays in the order of the requests; keeps its memory.
#[derive(Default)]
pub struct ShadowRays {
    packets: Vec<Rays>,
    count: usize,
    /// Lanes whose ray meets anything.
    blocked: Vec<Mask>,
}

/// Shadow rays of some lanes.
pub struct ShadowRequest {
    lanes: Mask,
    /// Number of the first ray.
    first: usize,
}

impl ShadowRequest {
    /// No rays.
    pub const NONE: Self = Self { lanes: Mask::NONE, first: 0 };
}

impl ShadowRays {
    /// Removes all rays.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Requests rays from surfaces to emitter points.
    pub fn towards_lights(&mut self, scene: &Scene, from: &Surfaces, lights: &Lights, lanes: Mask) -> ShadowRequest {
        self.request(lanes, || towards_lights(scene.accel.size(), from, lights))
    }

    /// Requests rays between surfaces.
    pub fn between(&mut self, a: &Surfaces, b: &Surfaces, lanes: Mask) -> ShadowRequest {
        self.request(lanes, || between(a, b))
    }

    fn request(&mut self, lanes: Mask, rays: impl FnOnce() -> Rays) -> ShadowRequest {
        let first = self.count;
        if !lanes.any() {
            return ShadowRequest { lanes, first };
        }
        self.count += lanes.count() as usize;
        self.packets.resize(self.packets.len().max(self.count.div_ceil(LANES)), Rays::NONE);
        append(&mut self.packets, first, &rays(), lanes);
        ShadowRequest { lanes, first }
    }

    /// Traces all rays.
    pub fn trace(&mut self, scene: &Scene, purpose: Purpose) {
        self.blocked.clear();
        let packets = &self.packets[..self.count.div_ceil(LANES)];
        self.blocked.extend(packets.iter().enumerate().map(|(k, rays)| {
            let active = Mask::first(self.count - k * LANES);
            scene.accel.occluded_packet(rays, active, purpose)
        }));
    }

    /// Lanes of a request whose ray meets nothing, once it is traced.
    pub fn unoccluded(&self, request: &ShadowRequest) -> Mask {
        let mut unoccluded = Mask::NONE;
        for (number, lane) in (request.first..).zip(request.lanes.lanes()) {
            unoccluded.0[lane] = !self.blocked[number / LANES].0[number % LANES];
        }
        unoccluded
    }
}

/// Writes the rays of some lanes side by side, from ray number `first` on.
fn append(packets: &mut [Rays], first: usize, rays: &Rays, lanes: Mask) {
    let [from, to] = [first / LANES, first % LANES];
    if to == 0 && lanes == Mask::first(LANES) {
        packets[from] = *rays;
        return;
    }
    for (number, lane) in (first..).zip(lanes.lanes()) {
        packets[number / LANES].copy(number % LANES, rays, lane);
    }
}

vectorized! {
    fn towards_lights(scene_size: f32, from: &Surfaces, lights: &Lights) -> Rays {
        lights.shadow_rays(scene_size, from)
    }
}

vectorized! {
    fn between(a: &Surfaces, b: &Surfaces) -> Rays {
        let origin = a.leave(b.p - a.p);
        let end = b.leave(a.p - b.p);
        Rays { origin, direction: end - origin, t_far: Lanes::splat(accel::SHADOW_END) }
    }
}
