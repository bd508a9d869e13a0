//! Next-event estimation at sixteen vertices, weighted against scattering (Veach 1997).

use super::Sampler;
use super::vertices::Vertices;
use crate::math::lanes::{Bits, Lanes, Lanes3};
use crate::scene::{Purpose, Scene};

/// Samples an emitter point for every vertex and keeps the visible ones. Returns MIS-weighted contributions to the
/// samples' colours, zero where a vertex receives no light.
#[inline(always)]
pub fn sample_emitters(scene: &Scene, sampler: &Sampler, depth: u32, hash: Bits, vertices: &mut Vertices) -> Lanes3 {
    let Vertices { surfaces, materials, light, throughput, .. } = vertices;
    let active = vertices.hit & materials.smooth();
    let numbers = sampler.light(hash, depth);
    let (found, pdf) = scene.sample_lights(surfaces, active, (numbers.choice, numbers.point), &mut light.points);
    let (direction, _) = light.points.seen_from(surfaces.p);
    let wo = surfaces.frame.to_local(direction);
    let mut evals = materials.eval(scene, surfaces, (surfaces.wi, wo), found);
    evals.pdf = light.points.scatter_pdf(evals.pdf);
    let radiance = scene.light_radiance(&light.points, direction, found & evals.value.nonzero());
    let lit = found & evals.value.scale(radiance).nonzero();
    (light.radiance, light.wo, light.evals, light.pdf) = (radiance, wo, evals, pdf);
    vertices.lit = if lit.any() { scene.visible_packet(surfaces, &light.points, lit, Purpose::Light) } else { lit };
    // Power heuristic with exponent two, over the density.
    let ratio = evals.pdf / pdf;
    let weight = Lanes::splat(1.0) / (pdf * (Lanes::splat(1.0) + ratio * ratio));
    vertices.lit.select3(throughput.scale(evals.value).scale(radiance) * weight, Lanes3::ZERO)
}
