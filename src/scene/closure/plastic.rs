//! Plastic: a dielectric coat, smooth or rough, over a diffuse base.

use std::f32::consts::FRAC_1_PI;

use super::facets::{Facets, Transmittance};
use super::sample::Lobe;
use super::{Deltas, Evals, Lobes, Numbers, Proposals, Scatters, parameters};
use crate::math::fresnel::lanes as fresnel;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::math::warp;

parameters! {
    /// Smooth plastic.
    Plastic {
        /// Interior over exterior index of refraction.
        eta: Lanes,
        /// Colour of the base with the light that the coat sends back to it, without the coat's transmittances.
        base: Lanes3,
        /// Colour of the coat's reflection.
        specular: Lanes3,
        /// Share of the coat in sampling where both are equally bright.
        share: Lanes,
    }
}

parameters! {
    /// Rough plastic.
    RoughPlastic {
        /// Interior over exterior index of refraction.
        eta: Lanes,
        /// Colour of the base with the light that the coat sends back to it, without the coat's transmittances.
        base: Lanes3,
        /// Colour of the coat's reflection.
        specular: Lanes3,
        /// Share of the coat in sampling where both are equally bright.
        share: Lanes,
        /// Facets of the coat.
        facets: Facets,
        /// Light that passes the coat.
        transmittance: Transmittance,
    }
}

/// Probabilities of sampling coats that reflect the given shares of light.
#[inline(always)]
fn coat_probability<const N: usize>(share: Lanes<N>, reflectance: Lanes<N>) -> Lanes<N> {
    let coat = reflectance * share;
    let sum = coat + (Lanes::ONE - reflectance) * (Lanes::ONE - share);
    sum.greater(Lanes::ZERO).select(coat / sum, Lanes::ONE)
}

/// Lanes in which both directions are on the outside.
#[inline(always)]
fn outside<const N: usize>(wi: Lanes3<N>, wo: Lanes3<N>) -> Mask<N> {
    wi.z.greater(Lanes::ZERO) & wo.z.greater(Lanes::ZERO)
}

impl<const N: usize> Plastic<N> {
    #[inline(always)]
    fn reflectance(&self, cos: Lanes<N>) -> Lanes<N> {
        fresnel::dielectric(cos, self.eta).reflectance
    }
}

impl<const N: usize> Lobes<N> for Plastic<N> {
    #[inline(always)]
    fn eval(&self, wi: Lanes3<N>, wo: Lanes3<N>) -> Evals<N> {
        let (ri, ro) = (self.reflectance(wi.z), self.reflectance(wo.z));
        let through = (Lanes::ONE - ri) * (Lanes::ONE - ro);
        let value = self.base * (Lanes::splat(FRAC_1_PI) * wo.z * through);
        let pdf = (Lanes::ONE - coat_probability(self.share, ri)) * warp::cosine_hemisphere_pdfs(wo.z);
        Evals { value, pdf }.only(outside(wi, wo))
    }

    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N> {
        let coat = numbers.lobe.less(coat_probability(self.share, self.reflectance(wi.z)));
        let (of_coat, by_coat) = self.delta(wi, Lobe::DeltaReflect).proposed(Lobe::DeltaReflect);
        let of_base = Scatters::towards(numbers.cosine, Lanes::ONE);
        (of_base.replaced(&of_coat, coat), (coat & by_coat) | (!coat & wi.z.greater(Lanes::ZERO)))
    }

    #[inline(always)]
    fn delta(&self, wi: Lanes3<N>, lobe: Lobe) -> Deltas<N> {
        if lobe != Lobe::DeltaReflect {
            return Deltas::NONE;
        }
        let reflectance = self.reflectance(wi.z);
        let probability = coat_probability(self.share, reflectance);
        let probability = wi.z.greater(Lanes::ZERO).select(probability, Lanes::ZERO);
        Deltas { wo: fresnel::reflect(wi), value: self.specular * reflectance, probability }
    }
}

impl<const N: usize> Lobes<N> for RoughPlastic<N> {
    #[inline(always)]
    fn eval(&self, wi: Lanes3<N>, wo: Lanes3<N>) -> Evals<N> {
        let m = (wi + wo).normalize_or(Lanes3::UP);
        let reflected = self.facets.reflect_pdf(wi, m);
        let reflectance = fresnel::dielectric(wi.dot(m), self.eta).reflectance;
        let specular = self.specular * (reflectance * reflected * self.facets.g1(wo, m));
        let (ti, to) = (self.transmittance.at(wi.z), self.transmittance.at(wo.z));
        let diffuse = self.base * (Lanes::splat(FRAC_1_PI) * wo.z * ti * to);
        let coat = coat_probability(self.share, Lanes::ONE - ti);
        let pdf = coat * reflected + (Lanes::ONE - coat) * warp::cosine_hemisphere_pdfs(wo.z);
        Evals { value: specular + diffuse, pdf }.only(outside(wi, wo))
    }

    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N> {
        let coat = numbers.lobe.less(coat_probability(self.share, Lanes::ONE - self.transmittance.at(wi.z)));
        let wo = coat.select3(fresnel::reflect_about(wi, numbers.facet), numbers.cosine);
        (Scatters::towards(wo, Lanes::ONE), outside(wi, wo))
    }

    #[inline(always)]
    fn facets(&self, _lobe: Lanes<N>) -> Option<Facets<N>> {
        Some(self.facets)
    }
}
