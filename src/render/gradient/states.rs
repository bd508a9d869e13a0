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

/// How an offset stands to its base path at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(u32)]
pub enum Kind {
    /// It is outside the image.
    Outside,
    /// It could not be continued.
    Failed,
    /// It has a vertex of its own.
    Apart,
    /// It has just joined the base path's vertex.
    Joining,
    /// It is the base path from the last vertex on.
    Joined,
}

/// Sixteen states.
#[derive(Clone)]
pub struct States {
    kind: Bits,
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
        Self { kind: Bits::ZERO, prefix, place: Bits::ZERO, wi: Lanes3::ZERO }
    }
}

impl States {
    /// Which stand so.
    #[inline(always)]
    pub fn are(&self, kind: Kind) -> Mask {
        self.kind.equal(kind as u32)
    }

    /// Which have an edge to tell of.
    #[inline(always)]
    pub fn inside(&self) -> Mask {
        !self.are(Kind::Outside)
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, kind: Kind, prefix: Prefix) {
        self.kind.0[lane] = kind as u32;
        self.prefix.throughput.set(lane, prefix.throughput);
        self.prefix.ratio.0[lane] = prefix.ratio;
    }

    /// One stands as another.
    pub fn copy(&mut self, lane: usize, from: &Self) {
        self.set(lane, Kind::Failed, from.prefix.get(lane));
        self.kind.0[lane] = from.kind.0[lane];
        self.place.0[lane] = from.place.0[lane];
        self.wi.set(lane, from.wi.get(lane));
    }

    /// One could not be continued.
    #[inline(always)]
    pub fn fail(&mut self, lane: usize) {
        self.kind.0[lane] = Kind::Failed as u32;
    }

    /// One has its own vertex.
    pub fn part(&mut self, lane: usize, prefix: Prefix, place: u32) {
        self.set(lane, Kind::Apart, prefix);
        self.place.0[lane] = place;
    }

    /// One has joined from the local direction given.
    #[inline(always)]
    pub fn join(&mut self, lane: usize, prefix: Prefix, wi: Vec3) {
        self.set(lane, Kind::Joining, prefix);
        self.wi.set(lane, wi);
    }

    /// One goes on as its base path.
    #[inline(always)]
    pub fn follow(&mut self, lane: usize, prefix: Prefix) {
        self.set(lane, Kind::Joined, prefix);
    }
}

/// The states at a level's vertices, of four edges. At a vertex an offset may stand differently for its light and for its
/// continuation: a material that is smooth and diffuse at once is joined for the one and not for the other.
#[derive(Default)]
pub struct Level {
    states: Vec<[States; 4]>,
    /// Those that continue differently, where there are such.
    continued: Vec<[States; 4]>,
    split: Vec<[Mask; 4]>,
}

impl Level {
    /// States of so many packets, none of which is inside yet.
    pub fn reset(&mut self, packets: usize) {
        self.states.resize_with(packets.max(self.states.len()), Default::default);
        self.continued.resize_with(packets.max(self.continued.len()), Default::default);
        self.split.clear();
        self.split.resize(packets, [Mask::NONE; 4]);
        self.states[..packets].iter_mut().flatten().for_each(|states| states.kind = Bits::ZERO);
    }

    /// States of a packet for an edge: for light and for the continuation.
    pub fn get(&mut self, packet: usize, edge: usize) -> (&States, &States) {
        let (states, split) = (&self.states[packet][edge], self.split[packet][edge]);
        if !split.any() {
            return (states, states);
        }
        let continued = &mut self.continued[packet][edge];
        for lane in (!split).lanes() {
            continued.copy(lane, states);
        }
        (states, continued)
    }

    /// Which offsets of a packet go on from vertices of their own, across any edge.
    pub fn apart(&mut self, packet: usize) -> Mask {
        (0..4).fold(Mask::NONE, |all, edge| all | self.get(packet, edge).1.are(Kind::Apart))
    }

    /// The states at a place, for light and, where it does not differ, for the continuation.
    #[inline(always)]
    pub fn at(&mut self, place: u32, edge: usize) -> (&mut States, usize) {
        let (packet, lane) = (place as usize / LANES, place as usize % LANES);
        (&mut self.states[packet][edge], lane)
    }

    /// The states at a place for a continuation that differs.
    pub fn continued_at(&mut self, place: u32, edge: usize) -> (&mut States, usize) {
        let (packet, lane) = (place as usize / LANES, place as usize % LANES);
        self.split[packet][edge].set(lane, true);
        (&mut self.continued[packet][edge], lane)
    }
}
