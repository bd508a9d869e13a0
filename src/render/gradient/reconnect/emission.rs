//! Differences of the light from emitters that base paths have hit by scattering.

use super::SegmentDifferences;
use super::difference::{Contributions, LastSegments};
use super::segment::{Segment, ShiftContext};
use crate::math::Rgb;
use crate::math::lanes::{Lanes, Lanes3, Mask};

impl Segment<'_> {
    /// Differences of the emitters at the ends of the segments, and of the ambient light behind them.
    #[inline(always)]
    pub fn emission_differences(&self, context: &ShiftContext) -> SegmentDifferences {
        let Self { vertices, offset, leaving, connected, extended, .. } = *self;
        let connectable = connected.connectable;
        let mut differences = SegmentDifferences::NONE;
        let emits = leaving & vertices.hits_emitter;
        if emits.any() {
            let emission = &vertices.emission;
            let ends = extended.ends.replaced(&connected.hit.ends, connected.hit.lanes);
            differences.color = self.emitted(emits, (emission.radiance, emission.light_pdf), ends);
        }
        if context.ambient {
            let mut ends = LastSegments {
                contribution: extended.possible.select3(extended.value, Lanes3::ZERO),
                density: extended.possible.select(extended.pdf, Lanes::ZERO),
            };
            if connectable.any() {
                let wo = offset.surfaces.frame.to_local(vertices.surfaces.frame.to_world(vertices.scatters.wo));
                let directions = (offset.surfaces.wi, wo);
                let evals = offset.materials.eval(context.scene, &offset.surfaces, directions, connectable);
                let found = LastSegments { contribution: evals.value, density: evals.pdf };
                ends = ends.replaced(&found, connectable);
            }
            differences.ambient = self.emitted(leaving, (Lanes3::splat(Rgb::ONE), Lanes::ZERO), ends);
        }
        differences
    }

    /// Differences of emitters at the ends of the active lanes' segments; unconnected offsets receive `ends`.
    #[inline(always)]
    fn emitted(&self, active: Mask, (radiance, light_pdf): (Lanes3, Lanes), ends: LastSegments) -> Lanes3 {
        let Self { vertices, states, moved, unconnected, .. } = self;
        let inv_survival = Lanes::splat(1.0) / vertices.survival;
        let pdf = vertices.scatters.pdf;
        let base = vertices.throughput.scale(vertices.scatters.weight).scale(radiance) * (pdf * inv_survival);
        let of_base = Contributions { base, density: pdf + light_pdf, inv_survival };
        let value = unconnected.select3(ends.contribution, moved.value.scale(radiance));
        let density = unconnected.select(ends.density, moved.pdf + light_pdf);
        let differences = of_base.differences(states.prefix.throughput.scale(value), states.prefix.ratio * density);
        active.select3(differences, Lanes3::ZERO)
    }
}
