//! Differences of the light from emitter points that next-event estimation has sampled at the base paths' vertices.

use super::connection::LightConnections;
use super::difference::{Contributions, LastSegments};
use super::extension::Extended;
use super::segment::ShiftContext;
use super::states::{Kind, States};
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::render::vertices::Vertices;

/// Differences over the active lanes; zero in the others.
#[inline(always)]
pub fn sampled_emitters(
    context: &ShiftContext,
    vertices: &Vertices,
    (connected, extended): (&LightConnections, &Extended),
    states: &States,
    active: Mask,
) -> Lanes3 {
    let Vertices { surfaces, materials, light, throughput, .. } = vertices;
    let base = throughput.scale(light.evals.value).scale(light.radiance);
    let of_base = Contributions { base, density: light.pdf + light.evals.pdf, inv_survival: Lanes::splat(1.0) };
    let mut ends = LastSegments::NONE;
    if (active & states.are(Kind::Unconnected)).any() {
        ends = extended.ends.replaced(&connected.ends, connected.lanes);
    }
    let just_connected = active & states.are(Kind::JustConnected);
    if just_connected.any() {
        let moved = materials.eval(context.scene, surfaces, (states.wi, light.wo), just_connected);
        let contribution = moved.value.scale(light.radiance);
        let density = light.pdf + light.points.scatter_pdf(moved.pdf);
        ends = ends.replaced(&LastSegments { contribution, density }, just_connected);
    }
    let LastSegments { contribution, density } = ends;
    let differences = of_base.differences(states.prefix.throughput.scale(contribution), states.prefix.ratio * density);
    active.select3(differences, Lanes3::ZERO)
}
