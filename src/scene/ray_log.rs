//! Every ray of a render as Embree was asked for it, to be asked for again and nothing else: what rendering cannot be
//! faster than.

use std::sync::Mutex;

use crate::ffi::embree::{Committed, Ray, Rays};

/// What was asked for.
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
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push(call);
    }

    /// A first hit was asked for.
    pub fn first(&self, ray: Ray) {
        self.add(Call::First(ray));
    }

    /// Any hit was asked for.
    pub fn any(&self, ray: Ray) {
        self.add(Call::Any(ray));
    }

    /// First hits were asked for.
    pub fn first_of_packet(&self, rays: Rays, coherent: bool) {
        self.add(Call::FirstOfPacket(rays, coherent));
    }

    /// Any hits were asked for.
    pub fn any_of_packet(&self, rays: Rays) {
        self.add(Call::AnyOfPacket(rays));
    }

    /// Asks for all again; returns the number of rays, and of those that met something.
    pub fn replay(&self, scene: &Committed) -> (usize, usize) {
        let calls = self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
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
