//! Sixteen paths at their vertices: light from sampled emitter points, scattering and Russian roulette.

use super::Sampler;
use super::direct::sample_emitters;
use super::paths::{Packet, Paths};
use super::vertices::Vertices;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::scene::bsdf::Lobe;
use crate::scene::emitter::Receiver;
use crate::scene::{Integrator, Scene};

/// Largest survival probability of Russian roulette, so that paths in white rooms end. Radiance that is reflected with
/// albedo r at every bounce has finite variance only if r² is less than this: the common 0.95 is too small for white
/// walls.
const MAX_SURVIVAL: f32 = 0.99;

/// The result of shading sixteen vertices.
pub struct Shaded {
    /// Light from sampled emitter points that reaches the camera, where vertices are lit.
    pub color: Lanes3,
    /// Paths whose throughput is not finite.
    pub non_finite: Mask,
}

vectorized! {
    /// Samples emitters at some vertices, then directions, and appends the paths that survive to `next`. `first_index` is the
    /// index of the first vertex among all of the level.
    pub fn shade(
        (scene, sampler): (&Scene, &Sampler),
        depth: u32,
        packet: &Packet,
        vertices: &mut Vertices,
        first_index: u32,
        next: &mut Paths,
    ) -> Shaded {
        let color = sample_emitters(scene, sampler, depth, packet.hash, vertices);
        let Vertices { surfaces, materials, scatters, .. } = vertices;
        let numbers = sampler.scatter(packet.hash, depth);
        let choices = (numbers.lobe, numbers.direction);
        let found = materials.sample(scene, surfaces, choices, vertices.hit, scatters);
        vertices.passed = found & scatters.are(Lobe::Null);
        let throughput = packet.throughput.scale(scatters.weight);
        let sum = throughput.x + throughput.y + throughput.z;
        let non_finite = found & !sum.abs().less(Lanes::splat(f32::INFINITY));
        let eta = packet.eta * scatters.eta;
        let brightest = throughput.max_element();
        let Integrator { rr_depth, .. } = scene.integrator();
        let one = Lanes::splat(1.0);
        let mut alive = found & brightest.greater(Lanes::ZERO);
        vertices.survival = one;
        if depth + 1 >= rr_depth {
            vertices.survival = (brightest * eta * eta).min(Lanes::splat(MAX_SURVIVAL));
            alive = alive & numbers.survival.less(vertices.survival);
        }
        vertices.scattered = alive;
        let throughput = throughput * (one / vertices.survival);
        let direction = surfaces.frame.to_world(scatters.wo).normalize_or(Lanes3::ZERO);
        let origin = surfaces.leave(direction);
        let smooth = scatters.are(Lobe::Smooth);
        for lane in alive.lanes() {
            vertices.next.0[lane] = next.len() as u32;
            let (to, slot) = next.push();
            to.rays.origin.set(slot, origin.get(lane));
            to.rays.direction.set(slot, direction.get(lane));
            to.rays.t_far.0[slot] = f32::INFINITY;
            to.throughput.set(slot, throughput.get(lane));
            to.eta.0[slot] = eta.0[lane];
            to.pdf.0[slot] = scatters.pdf.0[lane];
            to.smooth.0[slot] = smooth.0[lane];
            let Receiver { p, n } = scene.receiver(surfaces, lane);
            to.from.set(slot, p);
            to.facing.set(slot, n);
            to.id.0[slot] = packet.id.0[lane];
            to.hash.0[slot] = packet.hash.0[lane];
            to.parent.0[slot] = first_index + lane as u32;
        }
        Shaded { color, non_finite }
    }
}
