//! Boundaries between two transparent media: smooth, or microfacet surfaces (Walter et al. 2007).

use super::facets::Facets;
use super::sample::Lobe;
use super::{Deltas, Evals, Lobes, Numbers, Proposals, Scatters, parameters};
use crate::math::fresnel::lanes as fresnel;
use crate::math::lanes::{Lanes, Lanes3};

parameters! {
    /// A smooth boundary.
    Dielectric {
        /// Interior over exterior index of refraction.
        eta: Lanes,
        /// Factor on the reflectance.
        reflectance: Lanes3,
        /// Factor on the transmittance.
        transmittance: Lanes3,
    }
}

parameters! {
    /// A rough boundary.
    RoughDielectric {
        /// Interior over exterior index of refraction.
        eta: Lanes,
        /// Factor on the reflectance.
        reflectance: Lanes3,
        /// Factor on the transmittance.
        transmittance: Lanes3,
        /// Its facets.
        facets: Facets,
    }
}

impl<const N: usize> Lobes<N> for Dielectric<N> {
    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N> {
        let reflects = numbers.lobe.less(fresnel::dielectric(wi.z, self.eta).reflectance);
        let (reflected, reflection) = self.delta(wi, Lobe::DeltaReflect).proposed(Lobe::DeltaReflect);
        let (refracted, refraction) = self.delta(wi, Lobe::DeltaTransmit).proposed(Lobe::DeltaTransmit);
        let refracted = Scatters { eta: fresnel::eta_across(wi.z, self.eta), ..refracted };
        (refracted.replaced(&reflected, reflects), (reflects & reflection) | (!reflects & refraction))
    }

    #[inline(always)]
    fn delta(&self, wi: Lanes3<N>, lobe: Lobe) -> Deltas<N> {
        let found = fresnel::dielectric(wi.z, self.eta);
        let (wo, tint, probability, scale) = match lobe {
            Lobe::DeltaReflect => (fresnel::reflect(wi), self.reflectance, found.reflectance, Lanes::ONE),
            // Radiance is squeezed into the cone that it is refracted into.
            Lobe::DeltaTransmit => {
                let wo = fresnel::refract(wi, &found);
                (wo, self.transmittance, Lanes::ONE - found.reflectance, found.eta_ti * found.eta_ti)
            }
            _ => return Deltas::NONE,
        };
        let probability = wi.z.abs().greater(Lanes::ZERO).select(probability, Lanes::ZERO);
        Deltas { wo, value: tint * (probability * scale), probability }
    }
}

impl<const N: usize> Lobes<N> for RoughDielectric<N> {
    #[inline(always)]
    fn eval(&self, wi: Lanes3<N>, wo: Lanes3<N>) -> Evals<N> {
        let (zero, one) = (Lanes::ZERO, Lanes::ONE);
        let reflects = (wi.z * wo.z).greater(zero);
        let eta = fresnel::eta_across(wi.z, self.eta);
        let m = (wi + wo * reflects.select(one, eta)).normalize_or(Lanes3::ZERO);
        let m = m * one.copysign(m.z);
        let (cos_i, cos_o) = (wi.dot(m), wo.dot(m));
        // A facet shows both directions the side that the surface shows them, or nothing is scattered.
        let possible = (cos_i * wi.z).greater(zero) & (cos_o * wo.z).greater(zero);
        let reflectance = fresnel::dielectric(cos_i, self.eta).reflectance;
        // Solid angle of normal per solid angle of direction, eq. 17; and the cone that radiance is squeezed into.
        let sum = cos_i + eta * cos_o;
        let refracted = eta * eta * cos_o.abs() / (sum * sum);
        let change = reflects.select(Lanes::splat(0.25) / cos_o.abs(), refracted);
        let squeeze = reflects.select(one, one / (eta * eta));
        let share = reflects.select(reflectance, one - reflectance);
        let pdf = share * self.facets.visible_pdf(wi, m) * change;
        let tint = reflects.select3(self.reflectance, self.transmittance);
        let value = tint * (pdf * self.facets.g1(wo, m) * squeeze);
        Evals { value, pdf }.only(possible & pdf.greater(zero) & pdf.finite())
    }

    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N> {
        let (one, m) = (Lanes::ONE, numbers.facet);
        let found = fresnel::dielectric(wi.dot(m), self.eta);
        let reflects = numbers.lobe.less(found.reflectance);
        let wo = reflects.select3(fresnel::reflect_about(wi, m), fresnel::refract_about(wi, m, &found));
        let wo = wo.normalize_or(Lanes3::ZERO);
        // Facets may send light to the side it does not belong to.
        let cosines = wi.z * wo.z;
        let possible = (reflects & cosines.greater(Lanes::ZERO)) | (!reflects & cosines.less(Lanes::ZERO));
        (Scatters::towards(wo, reflects.select(one, one / found.eta_ti)), possible)
    }

    #[inline(always)]
    fn facets(&self, _lobe: Lanes<N>) -> Option<Facets<N>> {
        Some(self.facets)
    }
}
