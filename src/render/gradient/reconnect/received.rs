//! Light that base paths bring back to their vertices. From where an offset joins its base path on both receive the same, so
//! that all further differences are this light times one factor.

use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::render::record::PathRecord;
use crate::render::vertices::Vertices;

/// Light at sixteen vertices for a throughput of one, every contribution over the sum of the densities of the strategies that
/// sample it.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Received {
    /// Light from sampled emitter points.
    pub sampled: Lanes3,
    /// All other light: that of emitters hit by scattering, and what the next vertices receive.
    pub scattered: Lanes3,
    /// Ambient light of this vertex and those behind it.
    pub ambient: Lanes3,
}

/// Light at all vertices of a wave, by depth and packet.
#[derive(Default)]
pub struct ReceivedLight(Vec<Vec<Received>>);

impl Received {
    const NONE: Self = Self { sampled: Lanes3::ZERO, scattered: Lanes3::ZERO, ambient: Lanes3::ZERO };

    /// Light of the scene.
    #[inline(always)]
    pub fn total(&self) -> Lanes3 {
        self.sampled + self.scattered
    }

    /// Lanes that receive anything.
    #[inline(always)]
    pub fn any(&self) -> Mask {
        self.total().nonzero() | self.ambient.nonzero()
    }

    /// Light at the next vertices of a packet; `below` are those of the next depth. `ambient`: the ambient light, too.
    #[inline(always)]
    pub fn next(vertices: &Vertices, below: (&[Vertices], &[Self]), ambient: bool) -> Self {
        let mut next = Self::NONE;
        for (lane, packet, at) in vertices.followed_by(below.0) {
            let there = &below.1[packet];
            next.sampled.set(lane, there.sampled.get(at));
            next.scattered.set(lane, there.scattered.get(at));
            if ambient {
                next.ambient.set(lane, there.ambient.get(at));
            }
        }
        next
    }
}

impl ReceivedLight {
    /// Collects the light of a wave, from the ends of its paths to the camera. `ambient`: the ambient light, too.
    pub fn collect(&mut self, record: &PathRecord, ambient: bool) {
        let PathRecord { levels, packets, .. } = record;
        self.0.resize_with(self.0.len().max(packets.len()), Vec::new);
        for (depth, &count) in packets.iter().enumerate().rev() {
            let (above, below) = self.0.split_at_mut(depth + 1);
            let below = match packets.get(depth + 1) {
                Some(&packets) => (&levels[depth + 1][..packets], &below[0][..]),
                None => (&[][..], &[][..]),
            };
            above[depth].clear();
            above[depth].extend(levels[depth][..count].iter().map(|vertices| {
                let next = Received::next(vertices, below, ambient);
                received(vertices, &next, ambient)
            }));
        }
    }

    /// Light at the vertices of a depth; none behind the deepest.
    pub fn at(&self, depth: usize) -> &[Received] {
        self.0.get(depth).map_or(&[], Vec::as_slice)
    }
}

vectorized! {
    /// The light at some vertices, by that at the next ones.
    fn received(vertices: &Vertices, next: &Received, ambient: bool) -> Received {
        let Vertices { light, scatters, emission, .. } = vertices;
        let one = Lanes::splat(1.0);
        let lit = vertices.hit & vertices.lit;
        let at_points = light.evals.value.scale(light.radiance) * (one / (light.pdf + light.evals.pdf));
        let scattered = vertices.hit & vertices.scattered;
        let weight = scatters.weight * (one / vertices.survival);
        let hits = scattered & vertices.hits_emitter;
        let share = scatters.pdf / (scatters.pdf + emission.light_pdf);
        let at_emitters = hits.select3(emission.radiance * share, Lanes3::ZERO);
        let of_ambient = if ambient { weight.scale(Lanes3::ONE + next.ambient) } else { Lanes3::ZERO };
        Received {
            sampled: lit.select3(at_points, Lanes3::ZERO),
            scattered: scattered.select3(weight.scale(at_emitters + next.total()), Lanes3::ZERO),
            ambient: scattered.select3(of_ambient, Lanes3::ZERO),
        }
    }
}
