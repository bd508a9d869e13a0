//! Path tracing with next-event estimation and multiple importance sampling (Veach 1997), depths as Mitsuba's
//! `path` integrator counts them. What happens at a vertex, to sixteen paths at a time.

use super::Sampler;
use super::paths::{Packet, Paths};
use super::vertices::Vertices;
use crate::math::Rgb;
use crate::math::lanes::{Bits, Lanes, Lanes3, Mask};
use crate::scene::emitter::LightPoint;
use crate::scene::{Integrator, Scene};

/// Chance of surviving Russian roulette is never above this, so that paths in white rooms end. What is reflected r times
/// over has finite variance as long as r² is below it: 0.95, which is common, is too little for white walls.
const MAX_SURVIVAL: f32 = 0.99;

/// An emitter that a path has run into.
pub struct Met {
    /// The point.
    pub point: LightPoint,
    /// Radiance it sends back.
    pub radiance: Rgb,
    /// Density with which next-event estimation would have chosen it; 0 after a delta lobe.
    pub light_pdf: f32,
    /// What it adds to the colour of the sample.
    pub color: Rgb,
}

/// The emitter at the end of a path's latest segment: the surface it has met if `met`, else what surrounds the scene.
pub fn emission(scene: &Scene, packet: &Packet, vertices: &Vertices, lane: usize, met: bool) -> Option<Met> {
    let direction = packet.rays.direction.get(lane);
    let point = if met { scene.light_point_of(&vertices.surfaces, lane) } else { scene.environment(direction) }?;
    let radiance = scene.radiance(&point, -direction);
    if radiance == Rgb::ZERO {
        return None;
    }
    let smooth = packet.smooth.get(lane);
    let light_pdf = if smooth { scene.emitter_pdf(packet.from.get(lane), &point) } else { 0.0 };
    let ratio = light_pdf / packet.pdf.0[lane];
    let color = packet.throughput.get(lane) * radiance / (1.0 + ratio * ratio);
    Some(Met { point, radiance, light_pdf, color })
}

/// What has come of the paths at a vertex.
pub struct Shaded {
    /// Light from chosen emitter points that reaches the camera, where the vertices are lit.
    pub color: Lanes3,
    /// Which have a throughput that is not finite.
    pub broken: Mask,
}

/// Lights some vertices by emitter points and chooses where their paths go on. `first_place` is the number of the first one
/// among all of the level.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
pub fn shade(
    (scene, sampler): (&Scene, &Sampler),
    depth: u32,
    packet: &Packet,
    vertices: &mut Vertices,
    first_place: u32,
    onward: &mut Paths,
) -> Shaded {
    let color = light(scene, sampler, depth, packet.hash, vertices);
    let broken = scatter((scene, sampler), depth, packet, vertices, first_place, onward);
    Shaded { color, broken }
}

#[inline(always)]
fn light(scene: &Scene, sampler: &Sampler, depth: u32, hash: Bits, vertices: &mut Vertices) -> Lanes3 {
    let Vertices { surfaces, materials, light, throughput, .. } = vertices;
    let active = vertices.met & materials.smooth();
    let numbers = sampler.light(hash, depth);
    let (found, pdf) = scene.sample_lights(surfaces, active, (numbers.choice, numbers.point), &mut light.points);
    let (direction, _) = light.points.seen_from(surfaces.p);
    let wo = surfaces.frame.to_local(direction);
    let mut evals = materials.eval(scene, surfaces, (surfaces.wi, wo), found);
    evals.pdf = light.points.scatter_pdf(evals.pdf);
    let radiance = scene.light_radiance(&light.points, direction, found & evals.value.nonzero());
    let lit = found & evals.value.scale(radiance).nonzero();
    (light.radiance, light.wo, light.evals, light.pdf) = (radiance, wo, evals, pdf);
    vertices.lit = if lit.any() { scene.visible_packet(surfaces, &light.points, lit) } else { lit };
    // The power heuristic with exponent two, over the density.
    let ratio = evals.pdf / pdf;
    let weight = Lanes::splat(1.0) / (pdf * (Lanes::splat(1.0) + ratio * ratio));
    vertices.lit.select3(throughput.scale(evals.value).scale(radiance) * weight, Lanes3::ZERO)
}

#[inline(always)]
fn scatter(
    (scene, sampler): (&Scene, &Sampler),
    depth: u32,
    packet: &Packet,
    vertices: &mut Vertices,
    first_place: u32,
    onward: &mut Paths,
) -> Mask {
    let Vertices { surfaces, materials, scatters, .. } = vertices;
    let numbers = sampler.scatter(packet.hash, depth);
    let choices = (numbers.lobe, numbers.direction);
    let found = materials.sample(scene, surfaces, choices, vertices.met, scatters);
    let throughput = packet.throughput.scale(scatters.weight);
    let sum = throughput.x + throughput.y + throughput.z;
    let broken = found & !sum.abs().less(Lanes::splat(f32::INFINITY));
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
    let smooth = scatters.smooth();
    for lane in alive.lanes() {
        vertices.next.0[lane] = onward.len() as u32;
        let (to, slot) = onward.push();
        to.rays.origin.set(slot, origin.get(lane));
        to.rays.direction.set(slot, direction.get(lane));
        to.rays.t_far.0[slot] = f32::INFINITY;
        to.throughput.set(slot, throughput.get(lane));
        to.eta.0[slot] = eta.0[lane];
        to.pdf.0[slot] = scatters.pdf.0[lane];
        to.smooth.0[slot] = smooth.0[lane];
        to.from.set(slot, surfaces.p.get(lane));
        to.id.0[slot] = packet.id.0[lane];
        to.hash.0[slot] = packet.hash.0[lane];
        to.parent.0[slot] = first_place + lane as u32;
    }
    broken
}
