//! Metal, on the outside only: smooth, or a microfacet surface of perfect mirrors.

use super::facets::Facets;
use super::sample::Lobe;
use super::{Deltas, Evals, Lobes, Numbers, Proposals, Scatters, parameters};
use crate::math::fresnel::lanes as fresnel;
use crate::math::lanes::{Lanes, Lanes3};

parameters! {
    /// Smooth metal.
    Conductor {
        /// Real part of the index of refraction.
        eta: Lanes3,
        /// Absorption.
        k: Lanes3,
        /// Factor on the reflectance.
        tint: Lanes3,
    }
}

parameters! {
    /// Rough metal.
    RoughConductor {
        /// Real part of the index of refraction.
        eta: Lanes3,
        /// Absorption.
        k: Lanes3,
        /// Factor on the reflectance.
        tint: Lanes3,
        /// Its facets.
        facets: Facets,
    }
}

impl<const N: usize> Lobes<N> for Conductor<N> {
    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, _numbers: &Numbers<N>) -> Proposals<N> {
        self.delta(wi, Lobe::DeltaReflect).proposed(Lobe::DeltaReflect)
    }

    #[inline(always)]
    fn delta(&self, wi: Lanes3<N>, lobe: Lobe) -> Deltas<N> {
        if lobe != Lobe::DeltaReflect {
            return Deltas::NONE;
        }
        let value = fresnel::conductor(wi.z, self.eta, self.k).scale(self.tint);
        let probability = wi.z.greater(Lanes::ZERO).select(Lanes::ONE, Lanes::ZERO);
        Deltas { wo: fresnel::reflect(wi), value, probability }
    }
}

impl<const N: usize> RoughConductor<N> {
    #[inline(always)]
    fn reflectance(&self, cos: Lanes<N>) -> Lanes3<N> {
        fresnel::conductor(cos, self.eta, self.k).scale(self.tint)
    }
}

impl<const N: usize> Lobes<N> for RoughConductor<N> {
    #[inline(always)]
    fn eval(&self, wi: Lanes3<N>, wo: Lanes3<N>) -> Evals<N> {
        let above = wi.z.greater(Lanes::ZERO) & wo.z.greater(Lanes::ZERO);
        let m = (wi + wo).normalize_or(Lanes3::UP);
        let pdf = self.facets.reflect_pdf(wi, m);
        let value = self.reflectance(wi.dot(m)) * (pdf * self.facets.g1(wo, m));
        Evals { value, pdf }.only(above)
    }

    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N> {
        let wo = fresnel::reflect_about(wi, numbers.facet);
        (Scatters::towards(wo, Lanes::ONE), wi.z.greater(Lanes::ZERO) & wo.z.greater(Lanes::ZERO))
    }

    #[inline(always)]
    fn facets(&self, _lobe: Lanes<N>) -> Option<Facets<N>> {
        Some(self.facets)
    }
}
