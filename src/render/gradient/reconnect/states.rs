//! States of sixteen offset paths at the vertices of their base paths.

use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::math::{Rgb, Vec3};

/// The prefix of an offset path relative to that of its base path.
#[derive(Clone, Copy, Debug)]
pub struct Prefix {
    /// J f(y) / p(x).
    pub throughput: Rgb,
    /// J p(y) / p(x).
    pub ratio: f32,
}

/// Sixteen prefixes.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Prefixes {
    /// J f(y) / p(x).
    pub throughput: Lanes3,
    /// J p(y) / p(x).
    pub ratio: Lanes,
}

impl Prefixes {
    /// Appends a segment with the given factors. Returns the lanes that carry light on, too.
    #[inline(always)]
    pub fn extended(&self, value: Lanes3, ratio: Lanes) -> (Self, Mask) {
        let next = Self { throughput: self.throughput.scale(value), ratio: self.ratio * ratio };
        let carried = next.throughput.nonzero() & next.ratio.greater(Lanes::ZERO);
        (next, carried)
    }

    /// The prefix of one lane.
    pub fn get(&self, lane: usize) -> Prefix {
        Prefix { throughput: self.throughput.get(lane), ratio: self.ratio.0[lane] }
    }
}

/// State of an offset at a vertex of its base path.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(u32)]
pub enum Kind {
    /// Nothing is left to be added: the offset's pixel lies outside the film, the shift has failed, or the offset is the base path
    /// from an earlier vertex on.
    Closed,
    /// The offset has a vertex of its own.
    Unconnected,
    /// The offset reaches the base path's vertex from a vertex of its own.
    JustConnected,
}

/// Sixteen states.
#[derive(Clone)]
#[repr(align(64))]
pub struct States {
    kind: Bits,
    /// Prefixes of the offsets.
    pub prefix: Prefixes,
    /// Indices of the vertices of unconnected offsets.
    pub vertex_index: Bits,
    /// Local directions that just connected offsets come from.
    pub wi: Lanes3,
}

impl Default for States {
    fn default() -> Self {
        let prefix = Prefixes { throughput: Lanes3::ZERO, ratio: Lanes::ZERO };
        Self { kind: Bits::ZERO, prefix, vertex_index: Bits::ZERO, wi: Lanes3::ZERO }
    }
}

impl States {
    /// Lanes in a state.
    #[inline(always)]
    pub fn are(&self, kind: Kind) -> Mask {
        self.kind.equal(kind as u32)
    }

    /// Lanes with something left to be added.
    #[inline(always)]
    pub fn open(&self) -> Mask {
        !self.are(Kind::Closed)
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, kind: Kind, prefix: Prefix) {
        self.kind.0[lane] = kind as u32;
        self.prefix.throughput.set(lane, prefix.throughput);
        self.prefix.ratio.0[lane] = prefix.ratio;
    }

    /// Copies one lane of other states.
    pub fn copy(&mut self, lane: usize, from: &Self) {
        self.set(lane, Kind::Closed, from.prefix.get(lane));
        self.kind.0[lane] = from.kind.0[lane];
        self.vertex_index.0[lane] = from.vertex_index.0[lane];
        self.wi.set(lane, from.wi.get(lane));
    }

    /// Nothing is left to be added in one lane.
    #[inline(always)]
    pub fn close(&mut self, lane: usize) {
        self.kind.0[lane] = Kind::Closed as u32;
    }

    /// One lane has a vertex of its own.
    pub fn set_unconnected(&mut self, lane: usize, prefix: Prefix, vertex_index: u32) {
        self.set(lane, Kind::Unconnected, prefix);
        self.vertex_index.0[lane] = vertex_index;
    }

    /// One lane reaches the base path's vertex from the given local direction.
    #[inline(always)]
    pub fn set_just_connected(&mut self, lane: usize, prefix: Prefix, wi: Vec3) {
        self.set(lane, Kind::JustConnected, prefix);
        self.wi.set(lane, wi);
    }
}

/// States at the vertices of one depth, over the half-edges of their paths. At a vertex an offset may be in different states for its light
/// and for its continuation: a material with a diffuse and a specular lobe is connected to for the one and not for the
/// other.
#[derive(Default)]
pub struct LevelStates {
    /// States for the light sampled at the vertices.
    for_light: Vec<States>,
    /// States for the continuation, where they differ.
    for_scatter: Vec<States>,
    /// Lanes where they differ.
    differs: Vec<Mask>,
    /// Half-edges that there is room for at every vertex.
    slots: usize,
    /// Whether any offset is open.
    open: bool,
}

impl LevelStates {
    /// States of the given number of packets, with room for so many half-edges of each path, all of them closed.
    pub fn reset(&mut self, packets: usize, slots: usize) {
        (self.slots, self.open) = (slots, false);
        let count = packets * slots;
        self.for_light.resize_with(count.max(self.for_light.len()), Default::default);
        self.for_scatter.resize_with(count.max(self.for_scatter.len()), Default::default);
        self.differs.clear();
        self.differs.resize(count, Mask::NONE);
        self.for_light[..count].iter_mut().for_each(|states| states.kind = Bits::ZERO);
    }

    /// Whether anything is left to be added anywhere.
    pub fn any_open(&self) -> bool {
        self.open
    }

    /// States of a packet across half-edges of one number: for light and for the continuation.
    pub fn get(&self, packet: usize, slot: usize) -> (&States, &States) {
        let at = packet * self.slots + slot;
        (&self.for_light[at], if self.differs[at].any() { &self.for_scatter[at] } else { &self.for_light[at] })
    }

    /// States of a packet for light, across the first half-edges.
    pub fn for_light(&self, packet: usize, slots: usize) -> impl Iterator<Item = &States> {
        (0..slots).map(move |slot| self.get(packet, slot).0)
    }

    /// States of a packet for the continuation, across the first half-edges.
    pub fn for_scatter(&self, packet: usize, slots: usize) -> impl Iterator<Item = &States> {
        (0..slots).map(move |slot| self.get(packet, slot).1)
    }

    /// Completes the states of a packet for the continuation, across any of the first half-edges. Returns the lanes with an
    /// offset that has a vertex of its own, or nothing where all offsets are closed.
    pub fn unconnected_of_open(&mut self, packet: usize, slots: usize) -> Option<Mask> {
        let (mut open, mut unconnected) = (Mask::NONE, Mask::NONE);
        for slot in 0..slots {
            let at = packet * self.slots + slot;
            let (states, differs) = (&self.for_light[at], self.differs[at]);
            (open, unconnected) = (open | states.open(), unconnected | states.are(Kind::Unconnected));
            if differs.any() {
                let for_scatter = &mut self.for_scatter[at];
                (!differs).lanes().for_each(|lane| for_scatter.copy(lane, states));
                open = open | for_scatter.open();
                unconnected = unconnected | for_scatter.are(Kind::Unconnected);
            }
        }
        open.any().then_some(unconnected)
    }

    /// The state at a vertex for light and, where it does not differ, for the continuation.
    #[inline(always)]
    pub fn at(&mut self, vertex_index: u32, slot: usize) -> (&mut States, usize) {
        let (packet, lane) = (vertex_index as usize / LANES, vertex_index as usize % LANES);
        self.open = true;
        (&mut self.for_light[packet * self.slots + slot], lane)
    }

    /// The state at a vertex for a continuation that differs.
    pub fn at_for_scatter(&mut self, vertex_index: u32, slot: usize) -> (&mut States, usize) {
        let (packet, lane) = (vertex_index as usize / LANES, vertex_index as usize % LANES);
        let at = packet * self.slots + slot;
        self.open = true;
        self.differs[at].set(lane, true);
        (&mut self.for_scatter[at], lane)
    }
}
