//! How sixteen offset paths stand to their base paths at a vertex.

use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::math::{Rgb, Vec3};

/// What an offset path has gathered relative to its base path.
#[derive(Clone, Copy, Debug)]
pub struct Prefix {
    /// J f(y) / p(x).
    pub throughput: Rgb,
    /// J p(y) / p(x).
    pub ratio: f32,
}

/// [`Prefix`] of sixteen.
#[derive(Clone, Copy)]
pub struct Prefixes {
    /// J f(y) / p(x).
    pub throughput: Lanes3,
    /// J p(y) / p(x).
    pub ratio: Lanes,
}

impl Prefixes {
    /// Goes on by a segment with these factors; says which carry anything on.
    #[inline(always)]
    pub fn extended(&self, value: Lanes3, ratio: Lanes) -> (Self, Mask) {
        let next = Self { throughput: self.throughput.scale(value), ratio: self.ratio * ratio };
        let carried = next.throughput.nonzero() & next.ratio.greater(Lanes::ZERO);
        (next, carried)
    }

    /// One of them.
    pub fn get(&self, lane: usize) -> Prefix {
        Prefix { throughput: self.throughput.get(lane), ratio: self.ratio.0[lane] }
    }
}

impl Prefix {
    /// Goes on by a segment with these factors; `None` when nothing is carried on.
    pub fn extended(self, value: Rgb, ratio: f32) -> Option<Self> {
        let next = Self { throughput: self.throughput * value, ratio: self.ratio * ratio };
        (next.throughput != Rgb::ZERO && next.ratio > 0.0).then_some(next)
    }
}

/// Sixteen states. Those that are in none of the masks have failed, or are outside the image if not `inside`.
#[derive(Clone)]
pub struct States {
    /// Which have an edge to tell of.
    pub inside: Mask,
    /// Which have a vertex of their own.
    pub apart: Mask,
    /// Which have just joined their base paths' vertices.
    pub joining: Mask,
    /// Which are their base paths from the last vertex on.
    pub joined: Mask,
    /// What they have gathered.
    pub prefix: Prefixes,
    /// Places of the vertices of those apart.
    pub place: Bits,
    /// Local directions that those joining come from.
    pub wi: Lanes3,
}

impl Default for States {
    fn default() -> Self {
        let prefix = Prefixes { throughput: Lanes3::ZERO, ratio: Lanes::ZERO };
        let none = Mask::NONE;
        Self { inside: none, apart: none, joining: none, joined: none, prefix, place: Bits::ZERO, wi: Lanes3::ZERO }
    }
}

impl States {
    fn start(&mut self, lane: usize) {
        self.inside.set(lane, true);
        for mask in [&mut self.apart, &mut self.joining, &mut self.joined] {
            mask.set(lane, false);
        }
    }

    fn gather(&mut self, lane: usize, prefix: Prefix) {
        self.prefix.throughput.set(lane, prefix.throughput);
        self.prefix.ratio.0[lane] = prefix.ratio;
    }

    /// One could not be continued.
    pub fn fail(&mut self, lane: usize) {
        self.start(lane);
    }

    /// One has its own vertex.
    pub fn part(&mut self, lane: usize, prefix: Prefix, place: u32) {
        self.start(lane);
        self.apart.set(lane, true);
        self.gather(lane, prefix);
        self.place.0[lane] = place;
    }

    /// One has joined from the local direction given.
    pub fn join(&mut self, lane: usize, prefix: Prefix, wi: Vec3) {
        self.start(lane);
        self.joining.set(lane, true);
        self.gather(lane, prefix);
        self.wi.set(lane, wi);
    }

    /// One goes on as its base path.
    pub fn follow(&mut self, lane: usize, prefix: Prefix) {
        self.start(lane);
        self.joined.set(lane, true);
        self.gather(lane, prefix);
    }
}

/// The states at a level's vertices, of four edges. At a vertex an offset may stand differently for its light and for its
/// continuation: a material that is smooth and diffuse at once is joined for the one and not for the other.
#[derive(Default)]
pub struct Level {
    light: Vec<[States; 4]>,
    scatter: Vec<[States; 4]>,
}

impl Level {
    /// States of so many packets, none of which is inside yet.
    pub fn reset(&mut self, packets: usize) {
        for states in [&mut self.light, &mut self.scatter] {
            states.resize_with(packets.max(states.len()), Default::default);
            states[..packets].iter_mut().flatten().for_each(|states| states.inside = Mask::NONE);
        }
    }

    /// States of a packet for an edge: for light and for the continuation.
    pub fn get(&self, packet: usize, edge: usize) -> (&States, &States) {
        (&self.light[packet][edge], &self.scatter[packet][edge])
    }

    /// Which offsets of a packet go on from vertices of their own, across any edge.
    pub fn apart(&self, packet: usize) -> Mask {
        self.scatter[packet].iter().fold(Mask::NONE, |all, states| all | (states.apart & states.inside))
    }

    /// The states for the light and the continuation at a place.
    pub fn at(&mut self, place: u32, edge: usize) -> ([&mut States; 2], usize) {
        let (packet, lane) = (place as usize / LANES, place as usize % LANES);
        ([&mut self.light[packet][edge], &mut self.scatter[packet][edge]], lane)
    }
}
