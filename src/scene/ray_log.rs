//! Every ray query of a render, to be traced again on its own: the time that rendering cannot be
//! faster than.

use std::sync::Mutex;

use crate::ffi::embree::{Committed, Ray, Rays};
use crate::sync::lock;

/// A logged query.
enum Call {
    First(Ray),
    Any(Ray),
    FirstOfPacket(Rays, bool),
    AnyOfPacket(Rays),
}

/// The calls in their order.
#[derive(Default)]
pub struct RayLog(Mutex<Vec<Call>>);

impl RayLog {
    fn add(&self, call: Call) {
        lock(&self.0).push(call);
    }

    /// First hit of a ray.
    pub fn first(&self, ray: Ray) {
        self.add(Call::First(ray));
    }

    /// Any hit of a ray.
    pub fn any(&self, ray: Ray) {
        self.add(Call::Any(ray));
    }

    /// First hits of a packet.
    pub fn first_of_packet(&self, rays: Rays, coherent: bool) {
        self.add(Call::FirstOfPacket(rays, coherent));
    }

    /// Any hits of a packet.
    pub fn any_of_packet(&self, rays: Rays) {
        self.add(Call::AnyOfPacket(rays));
    }

    /// Traces all rays again; returns their number and the number of hits.
    pub fn replay(&self, scene: &Committed) -> (usize, usize) {
        let calls = lock(&self.0);
        let (mut rays, mut met) = (0, 0);
        let active = |packet: &Rays| packet.active.iter().filter(|lane| **lane != 0).count();
        for call in calls.iter() {
            let (asked, found) = match call {
                Call::First(ray) => (1, usize::from(scene.intersect(ray).is_some())),
                Call::Any(ray) => (1, usize::from(scene.occluded(ray))),
                Call::FirstOfPacket(packet, coherent) => {
                    let hits = scene.intersect_packet(packet, *coherent);
                    (
                        active(packet),
                        (0..16).filter(|&lane| packet.active[lane] != 0 && hits.get(lane).is_some()).count(),
                    )
                }
                Call::AnyOfPacket(packet) => {
                    let blocked = scene.occluded_packet(packet);
                    (active(packet), blocked.iter().filter(|lane| **lane != 0).count())
                }
            };
            (rays, met) = (rays + asked, met + found);
        }
        (rays, met)
    }
}
