//! Paths between two vertices, packed sixteen by sixteen, so that terminated paths leave no gaps.

use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::scene::packet::{Hits, Rays};

/// Sixteen paths between two vertices.
#[derive(Clone)]
#[repr(align(64))]
pub struct Packet {
    /// Rays of the current segments.
    pub rays: Rays,
    /// Throughput: product of f cos / pdf so far.
    pub throughput: Lanes3,
    /// Product of the relative indices of refraction.
    pub eta: Lanes,
    /// Density per solid angle of the last direction.
    pub pdf: Lanes,
    /// Lanes whose last direction is one of a smooth lobe.
    pub smooth: Mask,
    /// Point that the current segment leaves.
    pub from: Lanes3,
    /// Normals there, as [`Receiver`](crate::scene::emitter::Receiver) has them.
    pub facing: Lanes3,
    /// Indices of the samples in the wave.
    pub id: Bits,
    /// Hashes of the paths' random numbers.
    pub hash: Bits,
    /// Indices of the vertices that the segments leave.
    pub parent: Bits,
}

impl Packet {
    /// Nothing.
    pub const EMPTY: Self = Self {
        rays: Rays::NONE,
        throughput: Lanes3::ZERO,
        eta: Lanes::ZERO,
        pdf: Lanes::ZERO,
        smooth: Mask::NONE,
        from: Lanes3::ZERO,
        facing: Lanes3::ZERO,
        id: Bits::ZERO,
        hash: Bits::ZERO,
        parent: Bits::ZERO,
    };
}

/// Copies lanes of all of some fields of packets.
macro_rules! copy_lane {
    ($to:expr, $at:expr, $from:expr, $lane:expr; $($field:ident).+ $(, $($rest:ident).+)*) => {
        $to.$($field).+.0[$at] = $from.$($field).+.0[$lane];
        $(copy_lane!($to, $at, $from, $lane; $($rest).+);)*
    };
}

impl Packet {
    /// Copies one lane of another packet.
    #[inline(always)]
    fn copy(&mut self, to: usize, from: &Self, lane: usize) {
        copy_lane!(self, to, from, lane; rays.origin.x, rays.origin.y, rays.origin.z);
        copy_lane!(self, to, from, lane; rays.direction.x, rays.direction.y, rays.direction.z, rays.t_far);
        copy_lane!(self, to, from, lane; throughput.x, throughput.y, throughput.z, eta, pdf, smooth);
        copy_lane!(self, to, from, lane; from.x, from.y, from.z, id, hash, parent);
        copy_lane!(self, to, from, lane; facing.x, facing.y, facing.z);
    }
}

/// Paths in an order of their own.
#[derive(Default)]
pub struct Order {
    /// Hits of the paths' rays.
    pub hits: Vec<Hits>,
    /// Indices of the paths.
    indices: Vec<u32>,
}

impl Order {
    /// Puts paths of one key together, by their hits. Keys are at most `last`, which no path is moved for. Returns false
    /// where the paths had better stay where they are, since they have a single key besides.
    pub fn sort(&mut self, count: usize, last: usize, key: impl Fn(&Hits, usize) -> usize) -> bool {
        let key = |index: usize| key(&self.hits[index / LANES], index % LANES);
        let mut starts = vec![0u32; last + 2];
        (0..count).for_each(|index| starts[key(index) + 1] += 1);
        if starts[1..=last].iter().filter(|&&count| count > 0).count() < 2 {
            return false;
        }
        (1..starts.len()).for_each(|k| starts[k] += starts[k - 1]);
        self.indices.resize(count, 0);
        for index in 0..count {
            let start = &mut starts[key(index)];
            self.indices[*start as usize] = index as u32;
            *start += 1;
        }
        true
    }

    /// Gathers the paths of packet number `packet`, with their hits.
    pub fn gather(&self, packet: usize, paths: &Paths, to: &mut (Packet, Hits)) {
        let indices = self.indices.iter().skip(packet * LANES).take(LANES);
        for (lane, &index) in indices.enumerate() {
            let (from, at) = (index as usize / LANES, index as usize % LANES);
            to.0.copy(lane, &paths.packets[from], at);
            copy_hit(&mut to.1, lane, &self.hits[from], at);
        }
    }
}

/// Copies one lane of other hits.
#[inline(always)]
fn copy_hit(hits: &mut Hits, to: usize, from: &Hits, lane: usize) {
    (hits.t[to], hits.u[to], hits.v[to]) = (from.t[lane], from.u[lane], from.v[lane]);
    hits.geometry[to] = from.geometry[lane];
    (hits.primitive[to], hits.instance[to]) = (from.primitive[lane], from.instance[lane]);
}

/// Any number of paths.
#[derive(Default)]
pub struct Paths {
    packets: Vec<Packet>,
    count: usize,
}

impl Paths {
    /// Number of paths.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Removes all paths but keeps their memory.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Appends a path; returns its packet and lane.
    #[inline(always)]
    pub fn push(&mut self) -> (&mut Packet, usize) {
        let (packet, lane) = (self.count / LANES, self.count % LANES);
        if packet == self.packets.len() {
            self.packets.push(Packet::EMPTY);
        }
        self.count += 1;
        (&mut self.packets[packet], lane)
    }

    /// All packets with the lanes that hold a path.
    pub fn packets(&self) -> impl Iterator<Item = (&Packet, Mask)> {
        let packets = &self.packets[..self.count.div_ceil(LANES)];
        packets.iter().enumerate().map(|(k, packet)| (packet, Mask::first(self.count - k * LANES)))
    }
}
