//! Every ray query of a render, to be counted, and to be traced again on its own: the time that rendering cannot be
//! faster than.

use std::sync::Mutex;

use crate::ffi::embree::{Committed, Ray, Rays};
use crate::sync::lock;

/// Aim of the rays of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Purpose {
    /// Surfaces that the camera sees.
    Camera,
    /// Next vertices of paths.
    Path,
    /// Emitter points that paths have sampled.
    Light,
    /// Surfaces that the camera sees in the pixels that paths are shifted to.
    OffsetCamera,
    /// Emitter points and vertices of base paths that offsets are connected to.
    Connection,
    /// Next vertices of offsets that are not connected.
    Extension,
}

impl Purpose {
    /// Whether such rays start and run close together.
    pub fn is_coherent(self) -> bool {
        matches!(self, Self::Camera | Self::OffsetCamera)
    }
}

/// Rays of one purpose at one depth.
#[derive(Clone, Copy, Debug)]
pub struct Tally {
    /// Aim of the rays.
    pub purpose: Purpose,
    /// Vertex that they leave, for those of paths; the camera is number 0.
    pub depth: u32,
    /// Number of packets.
    pub packets: u64,
    /// Number of active rays in them.
    pub rays: u64,
}

/// The queries, in the order of their kind.
#[derive(Default)]
struct Calls {
    first: Vec<Ray>,
    any: Vec<Ray>,
    packets: Vec<(Rays, Purpose)>,
}

/// The queries so far.
#[derive(Default)]
pub struct RayLog(Mutex<Calls>);

impl RayLog {
    /// First hit of a ray.
    pub fn first(&self, ray: Ray) {
        lock(&self.0).first.push(ray);
    }

    /// Any hit of a ray.
    pub fn any(&self, ray: Ray) {
        lock(&self.0).any.push(ray);
    }

    /// First or any hits of a packet.
    pub fn packet(&self, rays: Rays, purpose: Purpose) {
        lock(&self.0).packets.push((rays, purpose));
    }

    /// Numbers of packets and rays by purpose and depth, of a render on one thread.
    pub fn tallies(&self) -> Vec<Tally> {
        let (mut tallies, mut depth, mut last) = (Vec::<Tally>::new(), 0, Purpose::Camera);
        for (rays, purpose) in &lock(&self.0).packets {
            // A wave goes from the camera to ever deeper vertices, where it first finds surfaces and then light.
            match purpose {
                Purpose::Path if last != Purpose::Path => depth += 1,
                Purpose::Camera => depth = 0,
                _ => {}
            }
            last = *purpose;
            let depth = if *purpose <= Purpose::Light { depth } else { 0 };
            let known = tallies.iter().position(|tally| (tally.purpose, tally.depth) == (*purpose, depth));
            let at = known.unwrap_or_else(|| {
                tallies.push(Tally { purpose: *purpose, depth, packets: 0, rays: 0 });
                tallies.len() - 1
            });
            tallies[at].packets += 1;
            tallies[at].rays += active(rays) as u64;
        }
        tallies.sort_by_key(|tally| (tally.purpose, tally.depth));
        tallies
    }

    /// Traces all rays again, or those of packets of one purpose; returns their number and the number of hits.
    pub fn replay(&self, scene: &Committed, purpose: Option<Purpose>) -> (usize, usize) {
        let calls = lock(&self.0);
        let (mut rays, mut met) = (0, 0);
        for (packet, of) in calls.packets.iter().filter(|(_, of)| purpose.is_none_or(|purpose| purpose == *of)) {
            rays += active(packet);
            met += trace(scene, packet, *of);
        }
        if purpose.is_none() {
            rays += calls.first.len() + calls.any.len();
            met += calls.first.iter().filter(|ray| scene.intersect(ray).is_some()).count();
            met += calls.any.iter().filter(|ray| scene.occluded(ray)).count();
        }
        (rays, met)
    }
}

fn active(packet: &Rays) -> usize {
    packet.active.iter().filter(|lane| **lane != 0).count()
}

/// Traces a packet; returns the number of hits.
fn trace(scene: &Committed, packet: &Rays, purpose: Purpose) -> usize {
    if matches!(purpose, Purpose::Light | Purpose::Connection) {
        return scene.occluded_packet(packet).iter().filter(|lane| **lane != 0).count();
    }
    let hits = scene.intersect_packet(packet, purpose.is_coherent());
    (0..16).filter(|&lane| packet.active[lane] != 0 && hits.get(lane).is_some()).count()
}
