//! The principled material for thin sheets: paper, leaves, bubbles. Both sides look the same.

use std::f32::consts::FRAC_1_PI;

use super::facets::{Facets, Ggx};
use super::{Evals, Lobes, Numbers, Proposals, Scatters, parameters, terms};
use crate::math::fresnel::lanes as fresnel;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::math::warp;

parameters! {
    /// All its lobes.
    PrincipledThin {
        /// Index of refraction of the sheet.
        eta: Lanes,
        /// Colour.
        base: Lanes3,
        /// Facets that reflect.
        reflecting: Ggx,
        /// Facets that transmit, narrowed by passing both boundaries.
        transmitting: Ggx,
        /// Perceived roughness.
        roughness: Lanes,
        /// Share of the specular lobes, of which either is sampled half the time.
        specular: Lanes,
        /// Share of diffuse light in the rest that passes.
        passing: Lanes,
        /// Share of the base's colour in the specular reflection.
        spec_tint: Lanes,
        /// Strength of the sheen.
        sheen: Lanes,
        /// Share of the base's colour in it.
        sheen_tint: Lanes,
        /// Share of flattened diffuse reflection.
        flatness: Lanes,
    }
}

impl<const N: usize> PrincipledThin<N> {
    #[inline(always)]
    fn diffuse_reflect(&self) -> Lanes<N> {
        (Lanes::ONE - self.specular) * (Lanes::ONE - self.passing)
    }

    #[inline(always)]
    fn diffuse_transmit(&self) -> Lanes<N> {
        (Lanes::ONE - self.specular) * self.passing
    }

    /// Lanes in which a number selects the specular reflection.
    #[inline(always)]
    fn mirrors(&self, lobe: Lanes<N>) -> Mask<N> {
        lobe.less(Lanes::splat(0.5) * self.specular)
    }

    /// The specular lobes, for `wi` above the sheet and `above`, the mirror image there of a direction that passes.
    #[inline(always)]
    fn specular(&self, wi: Lanes3<N>, wo: Lanes3<N>, above: Lanes3<N>, reflects: Mask<N>) -> Evals<N> {
        let m = (wi + above).normalize_or(Lanes3::UP);
        let cos = wi.dot(m);
        let dielectric = fresnel::dielectric(cos, self.eta).reflectance;
        let tinted = terms::schlick(terms::tint(self.base) * terms::schlick_r0(self.eta), cos, self.eta);
        let reflected = Lanes3::grey(dielectric).lerp(tinted, self.spec_tint);
        let color = reflects.select3(reflected, self.base * (Lanes::ONE - dielectric));
        let pdf = reflects.select(self.reflecting.reflect_pdf(wi, m), self.transmitting.reflect_pdf(wi, m));
        let masking = reflects.select(self.reflecting.g1(wo, m), self.transmitting.g1(wo, m));
        let value = color * (self.specular * pdf * masking);
        let evals = Evals { value, pdf: Lanes::splat(0.5) * self.specular * pdf };
        evals.only(self.specular.greater(Lanes::ZERO) & terms::same_side(m, wi, wo, reflects))
    }
}

impl<const N: usize> Lobes<N> for PrincipledThin<N> {
    #[inline(always)]
    fn eval(&self, wi: Lanes3<N>, wo: Lanes3<N>) -> Evals<N> {
        let scatters = (wi.z * wo.z).abs().greater(Lanes::ZERO);
        let below = wi.z.less(Lanes::ZERO);
        // The sheet is the same when it is turned around, tangents included.
        let (wi, wo) = (below.select3(-wi, wi), below.select3(-wo, wo));
        let reflects = wo.z.greater(Lanes::ZERO);
        let above = wo.mirror(!reflects);
        let specular = self.specular(wi, wo, above, reflects);
        let cos_d = (wi + above).normalize_or(Lanes3::UP).dot(wo);
        let diffuse = terms::diffuse([wi.z, wo.z, cos_d], self.roughness, self.flatness);
        let sheen = terms::sheen(self.base, (self.sheen, self.sheen_tint), cos_d);
        let reflected = (self.base * diffuse + sheen) * (self.diffuse_reflect() * wo.z);
        let passed = self.base * (self.diffuse_transmit() * Lanes::splat(FRAC_1_PI) * above.z);
        let share = reflects.select(self.diffuse_reflect(), self.diffuse_transmit());
        let pdf = specular.pdf + share * warp::cosine_hemisphere_pdfs(above.z);
        Evals { value: specular.value + reflects.select3(reflected, passed), pdf }.only(scatters)
    }

    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N> {
        let (lobe, m) = (numbers.lobe, numbers.facet);
        let below = wi.z.less(Lanes::ZERO);
        let from = below.select3(-wi, wi);
        let (specular, mirrors) = (lobe.less(self.specular), self.mirrors(lobe));
        let above = fresnel::reflect_about(from, m);
        let of_facets = above.mirror(!mirrors);
        let possible = above.z.greater(Lanes::ZERO) & terms::same_side(m, from, of_facets, mirrors);
        let returns = lobe.less(self.specular + self.diffuse_reflect());
        let diffuse = returns.select3(numbers.cosine, -numbers.cosine);
        let wo = specular.select3(of_facets, diffuse).normalize_or(Lanes3::ZERO);
        (Scatters::towards(below.select3(-wo, wo), Lanes::ONE), !specular | possible)
    }

    #[inline(always)]
    fn facets(&self, lobe: Lanes<N>) -> Option<Facets<N>> {
        let mirrors = self.mirrors(lobe);
        let alpha = [0, 1].map(|k| mirrors.select(self.reflecting.alpha[k], self.transmitting.alpha[k]));
        Some(Ggx { alpha }.into())
    }
}
