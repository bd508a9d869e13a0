//! Paths between two vertices, packed sixteen by sixteen, so that terminated paths leave no gaps.

use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::scene::packet::Rays;

/// Sixteen paths between two vertices.
#[derive(Clone)]
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
    /// Indices of the samples in the wave.
    pub id: Bits,
    /// Hashes of the paths' random numbers.
    pub hash: Bits,
    /// Indices of the vertices that the segments leave.
    pub parent: Bits,
}

impl Packet {
    const EMPTY: Self = Self {
        rays: Rays::NONE,
        throughput: Lanes3::ZERO,
        eta: Lanes::ZERO,
        pdf: Lanes::ZERO,
        smooth: Mask::NONE,
        from: Lanes3::ZERO,
        id: Bits::ZERO,
        hash: Bits::ZERO,
        parent: Bits::ZERO,
    };
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
