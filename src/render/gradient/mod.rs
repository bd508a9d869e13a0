//! Gradient-domain path tracing: see the README beside this file for the estimator.

mod offsets;
pub mod shift;
mod states;

use self::offsets::{NOTHING, OUTSIDE, Offsets};
use self::shift::{Room, Shift, Walk};
use self::states::{Level, Prefix};
use super::wave::{Traced, Views};
use crate::film::EDGES;
use crate::math::Rgb;
use crate::math::lanes::LANES;
use crate::scene::Scene;

/// Shifts the paths of waves to their neighbours; keeps its room between them.
pub struct Gradient {
    shift: Shift,
    ambient: bool,
    offsets: Offsets,
    states: Level,
    next: Level,
    room: Room,
}

impl Gradient {
    /// Differences by a shift, also those that an ambient light would make if asked for.
    pub fn new(shift: Shift, ambient: bool) -> Self {
        let (states, next) = (Level::default(), Level::default());
        Self { shift, ambient, offsets: Offsets::default(), states, next, room: Room::default() }
    }

    /// Whether paths must be recorded to be shifted; they are replayed otherwise.
    pub fn needs_vertices(&self) -> bool {
        self.shift != Shift::Replay
    }

    /// Adds this end of each edge to the samples.
    pub fn shift(&mut self, scene: &Scene, views: &Views, traced: &mut Traced) {
        let Shift::Reconnect { threshold } = self.shift else { return };
        let Traced { levels, packets: counts, samples, reach, .. } = traced;
        let packets = views.pixels.len().div_ceil(LANES);
        if self.ambient {
            reach.fill(u32::MAX);
        }
        self.offsets.start(scene, views, &levels[0][..packets]);
        self.start(packets, reach);
        for (k, &count) in counts.iter().enumerate() {
            let below = counts.get(k + 1).map_or(&[][..], |&packets| &levels[k + 1][..packets]);
            self.next.reset(below.len());
            let walk = Walk { scene, threshold, ambient: self.ambient, base: &levels[0][..packets], below };
            for (packet, vertices) in levels[k][..count].iter().enumerate() {
                // The other ends of the edges account for what copies of a dark path would carry.
                let mut lit = vertices.met;
                vertices.met.lanes().for_each(|lane| lit.set(lane, reach[vertices.id.0[lane] as usize] > k as u32));
                if !lit.any() {
                    continue;
                }
                let apart = self.states.apart(packet);
                let onward = walk.onward(vertices, lit, apart, |id| reach[id as usize] > k as u32 + 1);
                for edge in 0..EDGES.len() {
                    let states = self.states.get(packet, edge);
                    let inside = lit & states.0.inside();
                    let (room, next) = (&mut self.room, (&mut self.next, edge));
                    let difference = walk.step(room, (vertices, &onward), lit, states, next, &mut self.offsets);
                    for lane in inside.lanes() {
                        let sample = &mut samples[vertices.id.0[lane] as usize];
                        sample.edges[edge] += difference.light.get(lane);
                        if self.ambient {
                            sample.ambient.edges[edge] += difference.ambient.get(lane);
                        }
                    }
                }
            }
            std::mem::swap(&mut self.states, &mut self.next);
        }
    }

    /// Offsets of lit paths begin apart, where the camera sees anything.
    fn start(&mut self, packets: usize, reach: &[u32]) {
        self.states.reset(packets);
        let start = Prefix { throughput: Rgb::ONE, ratio: 1.0 };
        for (sample, _) in reach.iter().enumerate().filter(|(_, reach)| **reach > 0) {
            for edge in 0..EDGES.len() {
                let place = self.offsets.first(sample, edge);
                let (states, lane) = self.states.at(sample as u32, edge);
                match place {
                    OUTSIDE => {}
                    NOTHING => states.fail(lane),
                    place => states.part(lane, start, place),
                }
            }
        }
    }
}
