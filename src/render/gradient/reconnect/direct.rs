//! Differences of the light from emitter points that next-event estimation has sampled at the base paths' vertices.

use super::difference::{Contributions, LastSegments};
use super::half_vector;
use super::offsets::SurfacePacket;
use super::segment::ShiftContext;
use super::states::{Kind, States};
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::render::vertices::Vertices;
use crate::scene::bsdf::Lobe;

/// Differences over the active lanes; zero in the others.
#[inline(always)]
pub fn sampled_emitters(
    context: &ShiftContext,
    vertices: &Vertices,
    offset: &SurfacePacket,
    states: &States,
    active: Mask,
) -> Lanes3 {
    let Vertices { surfaces, materials, light, throughput, .. } = vertices;
    let scene = context.scene;
    let base = throughput.scale(light.evals.value).scale(light.radiance);
    let of_base = Contributions { base, density: light.pdf + light.evals.pdf, inv_survival: Lanes::splat(1.0) };
    let mut ends = LastSegments::NONE;
    let unconnected = active & states.are(Kind::Unconnected);
    if unconnected.any() {
        let both_diffuse = context.diffuse(materials.roughness()) & context.diffuse(offset.materials.roughness());
        // Nothing but next-event estimation samples an emitter of a single point, whatever the materials.
        let connected = unconnected & (light.points.delta | both_diffuse);
        ends = LastSegments::to_lights(scene, surfaces.p, offset, &light.points, connected);
        for lane in (unconnected & !connected).lanes() {
            let (base, offset) = (surfaces.get(lane), offset.surfaces.get(lane));
            let extension = half_vector::extend(scene, &base, (light.wo.get(lane), Lobe::Smooth), &offset);
            ends.set(lane, extension.and_then(|found| found.end(scene, &offset, &light.points.get(lane))));
        }
    }
    let just_connected = active & states.are(Kind::JustConnected);
    if just_connected.any() {
        let moved = materials.eval(scene, surfaces, (states.wi, light.wo), just_connected);
        ends.contribution = just_connected.select3(moved.value.scale(light.radiance), ends.contribution);
        ends.density = just_connected.select(light.pdf + light.points.scatter_pdf(moved.pdf), ends.density);
    }
    let connected = states.are(Kind::Connected);
    let value = connected.select3(light.evals.value.scale(light.radiance), ends.contribution);
    let density = connected.select(of_base.density, ends.density);
    let differences = of_base.differences(states.prefix.throughput.scale(value), states.prefix.ratio * density);
    active.select3(differences, Lanes3::ZERO)
}
