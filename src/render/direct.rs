//! Next-event estimation at sixteen vertices, weighted against scattering (Veach 1997).

use super::Sampler;
use super::continuation::Shaded;
use super::record::PathRecord;
use super::vertices::Vertices;
use crate::math::lanes::{Bits, Lanes, Lanes3};
use crate::scene::packet::{ShadowRays, ShadowRequest};
use crate::scene::{Purpose, Scene};

/// Samples an emitter point for every vertex; `lit` are the lanes with one that carries light, be it hidden. Returns
/// MIS-weighted contributions to the samples' colours, zero elsewhere.
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
    vertices.lit = found & evals.value.scale(radiance).nonzero();
    (light.radiance, light.wo, light.evals, light.pdf) = (radiance, wo, evals, pdf);
    // Power heuristic with exponent two, over the density.
    let ratio = evals.pdf / pdf;
    let weight = Lanes::splat(1.0) / (pdf * (Lanes::splat(1.0) + ratio * ratio));
    vertices.lit.select3(throughput.scale(evals.value).scale(radiance) * weight, Lanes3::ZERO)
}

/// Direct light of the vertices of a depth, held back until all their shadow rays are traced together.
#[derive(Default)]
pub struct DirectLight {
    /// Packets of vertices, by number.
    held: Vec<(usize, Shaded, ShadowRequest)>,
    shadows: ShadowRays,
}

impl DirectLight {
    /// Holds the light of packet number `packet` back.
    pub fn hold(&mut self, scene: &Scene, (packet, vertices): (usize, &Vertices), shaded: Shaded) {
        let request = self.shadows.towards_lights(scene, &vertices.surfaces, &vertices.light.points, vertices.lit);
        self.held.push((packet, shaded, request));
    }

    /// Adds what reaches its vertices of all that is held back to the record; they are lit by nothing else.
    pub fn add(&mut self, scene: &Scene, level: &mut [Vertices], record: &mut PathRecord) {
        self.shadows.trace(scene, Purpose::Light);
        for (packet, shaded, request) in self.held.drain(..) {
            let vertices = &mut level[packet];
            vertices.lit = self.shadows.unoccluded(&request);
            record.add_direct(scene, vertices, &shaded);
        }
        self.shadows.clear();
    }
}
