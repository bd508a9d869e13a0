//! Differences of the light from emitters that base paths have hit by scattering.

use super::SegmentDifferences;
use super::difference::{Contributions, LastSegments};
use super::half_vector::{Extension, LastSegment};
use super::segment::{OffsetSegment, ShiftContext};
use super::states::Kind;
use crate::math::Rgb;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::scene::Surface;

impl OffsetSegment<'_> {
    /// Differences of the emitters at the ends of the segments, and of the ambient light behind them.
    #[inline(always)]
    pub fn emission_differences(&self, context: &ShiftContext) -> SegmentDifferences {
        let Self { vertices, offset, leaving, unconnected, connectable, .. } = *self;
        let mut differences = SegmentDifferences { color: Lanes3::ZERO, ambient: Lanes3::ZERO };
        let emits = leaving & vertices.hits_emitter;
        if emits.any() {
            let emission = &vertices.emission;
            let mut ends = LastSegments::NONE;
            if (emits & connectable).any() {
                let base = vertices.surfaces.p;
                ends = LastSegments::to_lights(context.scene, base, offset, &emission.points, emits & connectable);
            }
            let point = |lane| emission.points.get(lane);
            let end = |found: &Extension, from: &Surface, lane| found.end(context.scene, from, &point(lane));
            self.set_extended(&mut ends, emits, end);
            differences.color = self.emitted(emits, (emission.radiance, emission.light_pdf), ends);
        }
        if context.ambient {
            let mut ends = LastSegments::NONE;
            let wo = offset.surfaces.frame.to_local(vertices.surfaces.frame.to_world(vertices.scatters.wo));
            let evals = offset.materials.eval(context.scene, &offset.surfaces, (offset.surfaces.wi, wo), connectable);
            ends.contribution = connectable.select3(evals.value, ends.contribution);
            ends.density = connectable.select(evals.pdf, ends.density);
            self.set_extended(&mut ends, unconnected, |found, _, _| Some(found.to_ambient()));
            differences.ambient = self.emitted(leaving, (Lanes3::splat(Rgb::ONE), Lanes::ZERO), ends);
        }
        differences
    }

    /// Sets the ends of the offsets that are extended, in the given lanes.
    fn set_extended(
        &self,
        ends: &mut LastSegments,
        lanes: Mask,
        end: impl Fn(&Extension, &Surface, usize) -> Option<LastSegment>,
    ) {
        for (lane, extension) in self.extensions.iter().filter(|(lane, _)| lanes.get(*lane)) {
            if let Some(extension) = extension {
                ends.set(*lane, end(extension, &self.offset.surfaces.get(*lane), *lane));
            }
        }
    }

    /// Differences of emitters at the ends of the active lanes' segments; unconnected offsets receive `ends`.
    #[inline(always)]
    fn emitted(&self, active: Mask, (radiance, light_pdf): (Lanes3, Lanes), ends: LastSegments) -> Lanes3 {
        let Self { vertices, states, base_scatter, unconnected, .. } = self;
        let inv_survival = Lanes::splat(1.0) / vertices.survival;
        let pdf = vertices.scatters.pdf;
        let base = vertices.throughput.scale(vertices.scatters.weight).scale(radiance) * (pdf * inv_survival);
        let of_base = Contributions { base, density: pdf + light_pdf, inv_survival };
        let connected = !(*unconnected | states.are(Kind::Failed));
        let value = connected.select3(base_scatter.value.scale(radiance), ends.contribution);
        let density = connected.select(base_scatter.pdf + light_pdf, ends.density);
        let differences = of_base.differences(states.prefix.throughput.scale(value), states.prefix.ratio * density);
        active.select3(differences, Lanes3::ZERO)
    }
}
