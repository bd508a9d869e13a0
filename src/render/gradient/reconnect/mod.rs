//! Reconnection where both paths scatter diffusely, half-vector copies elsewhere (Kettunen et al. 2015): the hybrid shift
//! of gradient-domain path tracing, for all paths of a wave together.
//!
//! ```text
//! base paths by depth ─┐
//! camera hits ─ offsets ┴─ segment ─┬─ direct, emission: differences
//!                          states ──┴─ continuation: states at the next depth
//! ```

pub mod connection;
mod continuation;
mod difference;
mod direct;
mod emission;
pub mod half_vector;
mod offsets;
mod segment;
mod states;

use self::direct::sampled_emitters;
use self::offsets::{MISS, OUT_OF_FILM, OffsetSurfaces};
use self::segment::{NextVertices, OffsetSegment, Scratch, ShiftContext};
use self::states::{Kind, LevelStates, Prefix, States};
use super::{ShiftKind, ShiftMapping};
use crate::math::Rgb;
use crate::math::lanes::{LANES, Lanes3, Mask};
use crate::render::camera::CameraSamples;
use crate::render::half_edges::HalfEdges;
use crate::render::record::PathRecord;
use crate::render::tracer::PathTracer;
use crate::render::vertices::Vertices;

/// `reconnect`.
pub const SHIFT: ShiftKind = ShiftKind {
    id: "reconnect",
    summary: "join the base path where it scatters diffusely",
    one_sided: false,
    make: |threshold, ambient| Box::new(Reconnect { threshold, ambient, ..Reconnect::default() }),
};

/// Costs of connecting and of extending an offset, in rays of paths (fitted to fourteen scenes): connections are made in packets,
/// extensions one by one.
const CONNECTION: f32 = 0.4;
const EXTENSION: f32 = 1.8;

/// The shift mapping with the memory that it keeps between waves.
#[derive(Default)]
struct Reconnect {
    threshold: f32,
    ambient: bool,
    offsets: OffsetSurfaces,
    states: LevelStates,
    next: LevelStates,
    scratch: Scratch,
}

/// One end's share of the differences over sixteen segments.
#[derive(Clone, Copy)]
struct SegmentDifferences {
    /// Differences of the scene's light.
    color: Lanes3,
    /// Differences of the ambient light, if they are recorded.
    ambient: Lanes3,
}

impl ShiftMapping for Reconnect {
    fn needs_vertices(&self) -> bool {
        true
    }

    fn shift(
        &mut self,
        tracer: &mut PathTracer,
        camera: &CameraSamples,
        record: &mut PathRecord,
        edges: &mut HalfEdges,
    ) {
        let packets = camera.pixels.len().div_ceil(LANES);
        if self.ambient {
            // The ambient light reaches every vertex.
            record.lit_length.fill(u32::MAX);
        }
        self.offsets.start(tracer.scene, camera, edges, &record.levels[0][..packets]);
        self.start(packets, &record.lit_length, edges);
        let PathRecord { levels, packets: counts, lit_length, .. } = record;
        for (depth, &count) in counts.iter().enumerate() {
            let below = counts.get(depth + 1).map_or(&[][..], |&packets| &levels[depth + 1][..packets]);
            self.next.reset(below.len(), edges.most());
            let context = ShiftContext {
                scene: tracer.scene,
                threshold: self.threshold,
                ambient: self.ambient,
                base: &levels[0][..packets],
                below,
            };
            for (packet, vertices) in levels[depth][..count].iter().enumerate() {
                self.shift_packet(&context, (depth as u32, packet), vertices, lit_length, edges);
            }
            std::mem::swap(&mut self.states, &mut self.next);
        }
        let Scratch { connected, extended, .. } = &mut self.scratch;
        record.work.offsets +=
            CONNECTION * std::mem::take(connected) as f32 + EXTENSION * std::mem::take(extended) as f32;
    }
}

impl Reconnect {
    /// Starts the offsets of all paths that receive light: unconnected, where the camera sees a surface.
    fn start(&mut self, packets: usize, lit_length: &[u32], edges: &HalfEdges) {
        self.states.reset(packets, edges.most());
        let start = Prefix { throughput: Rgb::ONE, ratio: 1.0 };
        for (sample, _) in lit_length.iter().enumerate().filter(|(_, length)| **length > 0) {
            for slot in 0..edges.degree(sample) {
                let vertex_index = self.offsets.first(sample, slot);
                let (states, lane) = self.states.at(sample as u32, slot);
                match vertex_index {
                    OUT_OF_FILM => {}
                    MISS => states.fail(lane),
                    vertex_index => states.set_unconnected(lane, start, vertex_index),
                }
            }
        }
    }

    /// Shifts the segments that leave sixteen vertices across all half-edges of their paths, number by number.
    fn shift_packet(
        &mut self,
        context: &ShiftContext,
        (depth, packet): (u32, usize),
        vertices: &Vertices,
        lit_length: &[u32],
        edges: &mut HalfEdges,
    ) {
        // The part of a path behind its last lit vertex contributes nothing: the other ends of the edges account for
        // whatever shifted copies of it would receive.
        let reaches = |id: u32, depth: u32| lit_length[id as usize] > depth;
        let mut reached = vertices.hit;
        vertices.hit.lanes().for_each(|lane| reached.set(lane, reaches(vertices.id.0[lane], depth)));
        if !reached.any() {
            return;
        }
        let slots = reached.lanes().map(|lane| edges.degree(vertices.id.0[lane] as usize)).max().unwrap_or(0);
        let unconnected = self.states.unconnected(packet, slots);
        let next = NextVertices::new(context, vertices, reached, unconnected, |id| reaches(id, depth + 1));
        for slot in 0..slots {
            let (for_light, for_scatter) = self.states.get(packet, slot);
            let inside = reached & for_light.inside();
            let step = Step { context, vertices, next: &next, active: reached, slot };
            let to = (&mut self.next, &mut self.offsets);
            let found = shift_segment(&step, &mut self.scratch, (for_light, for_scatter), to);
            for lane in inside.lanes() {
                let ambient = if self.ambient { found.ambient.get(lane) } else { Rgb::ZERO };
                edges.add(vertices.id.0[lane] as usize, slot, (found.color.get(lane), ambient));
            }
        }
    }
}

/// The offsets of sixteen base paths across a half-edge of each, on the way from one vertex to the next.
struct Step<'a> {
    context: &'a ShiftContext<'a>,
    vertices: &'a Vertices,
    next: &'a NextVertices,
    active: Mask,
    /// Number of the half-edge among those of each path.
    slot: usize,
}

vectorized! {
    /// Returns the differences of the light sampled at the vertices and of the emitters hit next, and sets the states of the
    /// offsets at the next vertices.
    fn shift_segment(
        step: &Step,
        scratch: &mut Scratch,
        (for_light, for_scatter): (&States, &States),
        (next_states, offsets): (&mut LevelStates, &mut OffsetSurfaces),
    ) -> SegmentDifferences {
        let Step { context, vertices, next, active, slot } = *step;
        scratch.load_offsets(context, offsets, (for_light, for_scatter), active);
        let lit = active & vertices.lit & for_light.inside();
        scratch.connected += (lit & for_light.are(Kind::Unconnected)).count();
        let sampled =
            if lit.any() { sampled_emitters(context, vertices, scratch.offset(), for_light, lit) } else { Lanes3::ZERO };
        let ambient = if context.ambient { active } else { Mask::NONE };
        let leaving = active & for_scatter.inside() & vertices.scattered & (next.exists | vertices.hits_emitter | ambient);
        if !leaving.any() {
            return SegmentDifferences { color: sampled, ambient: Lanes3::ZERO };
        }
        let segment = OffsetSegment::new(context, vertices, scratch, for_scatter, leaving);
        let hit = segment.emission_differences(context);
        segment.continue_offsets(context, next, (next_states, slot), offsets);
        SegmentDifferences { color: sampled + hit.color, ambient: hit.ambient }
    }
}
