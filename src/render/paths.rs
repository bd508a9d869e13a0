//! Paths on their way, packed sixteen by sixteen so that those that have ended leave no gaps.

use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::scene::packet::Rays;

/// Sixteen paths between two vertices.
#[derive(Clone)]
pub struct Packet {
    /// Where they go.
    pub rays: Rays,
    /// f cos / pdf of everything before.
    pub throughput: Lanes3,
    /// Product of the relative indices of refraction.
    pub eta: Lanes,
    /// Density of the last direction.
    pub pdf: Lanes,
    /// Whether it was one of a smooth lobe.
    pub smooth: Mask,
    /// Where it was taken.
    pub from: Lanes3,
    /// Numbers of their samples in the wave.
    pub id: Bits,
    /// What tells their random numbers apart.
    pub hash: Bits,
    /// Their places among the vertices before.
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

    /// Forgets all paths, but keeps their room.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Makes room for another path; returns where.
    #[inline(always)]
    pub fn push(&mut self) -> (&mut Packet, usize) {
        let (packet, lane) = (self.count / LANES, self.count % LANES);
        if packet == self.packets.len() {
            self.packets.push(Packet::EMPTY);
        }
        self.count += 1;
        (&mut self.packets[packet], lane)
    }

    /// The packets, and which of their lanes hold a path.
    pub fn packets(&self) -> impl Iterator<Item = (&Packet, Mask)> {
        let packets = &self.packets[..self.count.div_ceil(LANES)];
        packets.iter().enumerate().map(|(k, packet)| (packet, Mask::first(self.count - k * LANES)))
    }
}
