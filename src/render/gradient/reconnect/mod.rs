//! Reconnection where both paths scatter diffusely, half-vector copies elsewhere (Kettunen et al. 2015): the hybrid shift
//! of gradient-domain path tracing, for all paths of a wave together.
//!
//! ```text
//! base paths by depth -+- received: light at and behind every vertex
//! camera hits - offsets - extension: half-vector copies of all offsets of a packet
//!                 |
//!              segment -+- direct, emission: differences of single emitters
//!              states --+- continuation: states at the next depth; where an offset joins its base path, all the rest at once
//! ```

pub mod connection;
mod continuation;
mod difference;
mod direct;
mod emission;
mod extension;
pub mod half_vector;
mod offsets;
mod received;
mod segment;
mod states;

use std::ops::AddAssign;

use self::connection::Connected;
use self::direct::sampled_emitters;
use self::extension::{Extended, Extensions};
use self::offsets::{MISS, OUT_OF_FILM, OffsetSurfaces, SurfacePacket};
use self::received::ReceivedLight;
use self::segment::{NextVertices, Segment, ShiftContext};
use self::states::{Kind, LevelStates, Prefix, States};
use super::{ShiftKind, ShiftMapping};
use crate::math::Rgb;
use crate::math::lanes::{LANES, Lanes3, Mask};
use crate::render::camera::CameraSamples;
use crate::render::half_edges::HalfEdges;
use crate::render::record::PathRecord;
use crate::render::tracer::PathTracer;
use crate::render::vertices::Vertices;
use crate::scene::Purpose;
use crate::scene::packet::ShadowRays;

/// `reconnect`.
pub const SHIFT: ShiftKind = ShiftKind {
    id: "reconnect",
    summary: "join the base path where it scatters diffusely",
    one_sided: false,
    make: |threshold, ambient| Box::new(Reconnect { threshold, ambient, ..Reconnect::default() }),
};

/// Costs of connecting and of extending an offset, in rays of paths (fitted to fourteen scenes).
const CONNECTION: f32 = 0.4;
const EXTENSION: f32 = 1.8;

/// The shift mapping with the memory that it keeps between waves.
#[derive(Default)]
struct Reconnect {
    threshold: f32,
    ambient: bool,
    received: ReceivedLight,
    offsets: OffsetSurfaces,
    states: LevelStates,
    next: LevelStates,
    extensions: Extensions,
    /// Offsets of a packet, by half-edge, and their shadow rays.
    packets: Vec<OffsetPacket>,
    shadows: ShadowRays,
    /// Offsets that were connected in this wave.
    connected: u32,
}

/// One end's share of the differences over sixteen segments.
#[derive(Clone, Copy)]
struct SegmentDifferences {
    /// Differences of the scene's light.
    color: Lanes3,
    /// Differences of the ambient light, if they are recorded.
    ambient: Lanes3,
}

impl SegmentDifferences {
    const NONE: Self = Self { color: Lanes3::ZERO, ambient: Lanes3::ZERO };
}

impl AddAssign for SegmentDifferences {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.color += other.color;
        self.ambient += other.ambient;
    }
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
        self.received.collect(record, self.ambient);
        let PathRecord { levels, packets: counts, .. } = &*record;
        let base = counts.first().map_or(&[][..], |&packets| &levels[0][..packets]);
        self.offsets.start((tracer.scene, self.threshold), camera, edges, base);
        self.start(camera.pixels.len(), edges);
        let received = std::mem::take(&mut self.received);
        (self.connected, self.extensions.count) = (0, 0);
        for (depth, &count) in counts.iter().enumerate() {
            if !self.states.any_open() {
                break;
            }
            let below = counts.get(depth + 1).map_or(&[][..], |&packets| &levels[depth + 1][..packets]);
            self.next.reset(below.len(), edges.most());
            for (packet, vertices) in levels[depth][..count].iter().enumerate() {
                let context = ShiftContext {
                    scene: tracer.scene,
                    threshold: self.threshold,
                    ambient: self.ambient,
                    base,
                    below: (below, received.at(depth + 1)),
                };
                let active = vertices.hit & received.at(depth)[packet].any();
                if active.any() {
                    self.shift_packet(&context, (packet, vertices, active), edges);
                }
            }
            std::mem::swap(&mut self.states, &mut self.next);
            self.offsets.advance();
        }
        self.received = received;
        record.work.offsets += CONNECTION * self.connected as f32 + EXTENSION * self.extensions.count as f32;
    }
}

impl Reconnect {
    /// Starts the offsets of all paths that receive light: unconnected, where the camera sees a surface.
    fn start(&mut self, paths: usize, edges: &mut HalfEdges) {
        let received = self.received.at(0);
        self.states.reset(received.len(), edges.most());
        let start = Prefix { throughput: Rgb::ONE, ratio: 1.0 };
        for path in 0..paths {
            let (light, lane) = (&received[path / LANES], path % LANES);
            let (color, ambient) = (light.total().get(lane), light.ambient.get(lane));
            if color == Rgb::ZERO && ambient == Rgb::ZERO {
                continue;
            }
            for slot in 0..edges.degree(path) {
                match self.offsets.first(path, slot) {
                    OUT_OF_FILM => {}
                    MISS => edges.add(path, slot, (-color, Some(-ambient))),
                    vertex_index => {
                        let (states, lane) = self.states.at(path as u32, slot);
                        states.set_unconnected(lane, start, vertex_index);
                    }
                }
            }
        }
    }

    /// Shifts the segments that leave sixteen vertices across all half-edges of their paths, number by number.
    fn shift_packet(
        &mut self,
        context: &ShiftContext,
        (packet, vertices, active): (usize, &Vertices, Mask),
        edges: &mut HalfEdges,
    ) {
        let slots = active.lanes().map(|lane| edges.degree(vertices.id.0[lane] as usize)).max().unwrap_or(0);
        let Some(unconnected) = self.states.unconnected_of_open(packet, slots) else { return };
        let next = NextVertices::new(context, vertices, active & unconnected);
        let at = (context, vertices, active);
        self.extensions.extend_to_lights(at, self.states.for_light(packet, slots), &mut self.offsets);
        self.extensions.extend_to_vertices(at, &next, self.states.for_scatter(packet, slots), &mut self.offsets);
        self.connect((context, packet), (vertices, &next, active), slots);
        for slot in 0..slots {
            let offset = &mut self.packets[slot];
            if !offset.open.any() {
                continue;
            }
            offset.connected.remove_occluded(&self.shadows);
            let step = Step { context, vertices, next: &next, offset, slot };
            let states = self.states.get(packet, slot);
            let found = shift_segment(&step, states, self.extensions.get(slot), &mut self.next);
            for lane in step.offset.open.lanes() {
                let ambient = self.ambient.then(|| found.ambient.get(lane));
                edges.add(vertices.id.0[lane] as usize, slot, (found.color.get(lane), ambient));
            }
        }
    }

    /// Connects the unconnected offsets of a packet across all half-edges and traces all their shadow rays.
    fn connect(
        &mut self,
        (context, packet): (&ShiftContext, usize),
        (vertices, next, active): (&Vertices, &NextVertices, Mask),
        slots: usize,
    ) {
        self.shadows.clear();
        self.packets.resize_with(slots.max(self.packets.len()), OffsetPacket::default);
        for (slot, to) in self.packets.iter_mut().enumerate().take(slots) {
            let (for_light, for_scatter) = self.states.get(packet, slot);
            to.open = active & (for_light.open() | for_scatter.open());
            let [light, scatter] = [for_light, for_scatter].map(|states| to.open & states.are(Kind::Unconnected));
            to.connected = Connected::NONE;
            if (light | scatter).any() {
                let vertex_index = light.select_bits(for_light.vertex_index, for_scatter.vertex_index);
                self.offsets.load(context.base, vertex_index, light | scatter, &mut to.surfaces);
                connect(context, (vertices, next), (light, scatter), (to, &mut self.shadows));
            }
            self.connected += (light & vertices.lit).count() + to.connected.connectable.count();
        }
        self.shadows.trace(context.scene, Purpose::Connection);
    }
}

/// Offsets of sixteen base paths across a half-edge of each.
struct OffsetPacket {
    /// Lanes whose offset is open.
    open: Mask,
    /// Surfaces of the unconnected ones.
    surfaces: SurfacePacket,
    connected: Connected,
}

impl Default for OffsetPacket {
    fn default() -> Self {
        Self { open: Mask::NONE, surfaces: SurfacePacket::default(), connected: Connected::NONE }
    }
}

/// The offsets of sixteen base paths across a half-edge of each, on the way from one vertex to the next.
struct Step<'a> {
    context: &'a ShiftContext<'a>,
    vertices: &'a Vertices,
    next: &'a NextVertices,
    offset: &'a OffsetPacket,
    /// Number of the half-edge among those of each path.
    slot: usize,
}

vectorized! {
    /// Connects the offsets that are unconnected in their states for light and for the continuation.
    fn connect(
        context: &ShiftContext,
        base: (&Vertices, &NextVertices),
        unconnected: (Mask, Mask),
        (offset, shadows): (&mut OffsetPacket, &mut ShadowRays),
    ) {
        offset.connected = Connected::new(context, base, &offset.surfaces, unconnected, shadows);
    }
}

vectorized! {
    /// Returns the differences of the light sampled at the vertices, of the emitters hit next, and of everything behind offsets
    /// that are closed, and sets the states of the offsets at the next vertices.
    fn shift_segment(
        step: &Step,
        (for_light, for_scatter): (&States, &States),
        (to_light, to_vertex): (&Extended, &Extended),
        next_states: &mut LevelStates,
    ) -> SegmentDifferences {
        let Step { context, vertices, next, offset, slot } = *step;
        let OffsetPacket { open, surfaces, connected } = offset;
        let lit = *open & vertices.lit & for_light.open();
        let mut differences = SegmentDifferences::NONE;
        if lit.any() {
            differences.color = sampled_emitters(context, vertices, (&connected.sampled, to_light), for_light, lit);
        }
        let leaving = context.leaving(vertices, next, *open & for_scatter.open());
        if leaving.any() {
            let offset = (surfaces, connected, to_vertex);
            let segment = Segment::new(context, (vertices, next), offset, for_scatter, leaving);
            differences += segment.emission_differences(context);
            differences += segment.continue_offsets((next_states, slot));
        }
        differences
    }
}
