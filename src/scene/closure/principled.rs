//! The principled material: diffuse, metal, rough glass, clearcoat and sheen in one (Burley 2012 and 2015).

use super::facets::{Facets, Ggx};
use super::terms::{self, Clearcoat};
use super::{Evals, Lobes, Numbers, Proposals, Scatters, parameters};
use crate::math::fresnel::lanes as fresnel;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::math::warp;

parameters! {
    /// All its lobes.
    Principled {
        /// Interior over exterior index of refraction.
        eta: Lanes,
        /// Colour.
        base: Lanes3,
        /// Facets of the main specular lobe.
        facets: Ggx,
        /// Perceived roughness.
        roughness: Lanes,
        /// Share of metal.
        metallic: Lanes,
        /// Share of glass in the rest.
        spec_trans: Lanes,
        /// Share of the base's colour in the specular reflection.
        spec_tint: Lanes,
        /// Strength of the sheen.
        sheen: Lanes,
        /// Share of the base's colour in it.
        sheen_tint: Lanes,
        /// Share of flattened diffuse reflection.
        flatness: Lanes,
        /// Strength of the clearcoat.
        clearcoat: Lanes,
        /// Roughness of its facets.
        clearcoat_alpha: Lanes,
    }
}

/// How often each lobe is sampled; they sum to one.
struct Probabilities<const N: usize> {
    reflect: Lanes<N>,
    transmit: Lanes<N>,
    coat: Lanes<N>,
    diffuse: Lanes<N>,
}

impl<const N: usize> Principled<N> {
    /// Share of the opaque dielectric.
    #[inline(always)]
    fn brdf(&self) -> Lanes<N> {
        (Lanes::ONE - self.metallic) * (Lanes::ONE - self.spec_trans)
    }

    /// Share of the transparent dielectric.
    #[inline(always)]
    fn bsdf(&self) -> Lanes<N> {
        (Lanes::ONE - self.metallic) * self.spec_trans
    }

    #[inline(always)]
    fn coat(&self) -> Clearcoat<N> {
        Clearcoat { alpha: self.clearcoat_alpha }
    }

    /// Reflectance of a facet from the front: metal and tinted specular by Schlick, the rest by Fresnel.
    #[inline(always)]
    fn front_reflectance(&self, cos: Lanes<N>, dielectric: Lanes<N>) -> Lanes3<N> {
        let one = Lanes::ONE;
        let eta_it = cos.less(Lanes::ZERO).select(one / self.eta, self.eta);
        let tinted = terms::tint(self.base) * terms::schlick_r0(eta_it);
        let opaque = one - self.metallic;
        terms::schlick(self.base, cos, self.eta) * self.metallic
            + terms::schlick(tinted, cos, self.eta) * (opaque * self.spec_tint)
            + Lanes3::grey(opaque * (one - self.spec_tint) * dielectric)
    }

    #[inline(always)]
    fn probabilities(&self, front: Mask<N>, reflectance: Lanes<N>) -> Probabilities<N> {
        let (zero, one) = (Lanes::ZERO, Lanes::ONE);
        let transmitted = one - reflectance;
        let through = self.bsdf() * transmitted;
        // Inside, there are only the boundary's two ways.
        let reflect = front.select(one - through, reflectance);
        let transmit = front.select(through, transmitted);
        let coat = front.select(Lanes::splat(0.25) * self.clearcoat, zero);
        let diffuse = front.select(self.brdf(), zero);
        let scale = one / (reflect + transmit + coat + diffuse);
        Probabilities {
            reflect: reflect * scale,
            transmit: transmit * scale,
            coat: coat * scale,
            diffuse: diffuse * scale,
        }
    }

    /// Lanes in which anything is scattered from the side of `wi`.
    #[inline(always)]
    fn scatters(&self, wi: Lanes3<N>) -> Mask<N> {
        wi.z.greater(Lanes::ZERO) | (wi.z.less(Lanes::ZERO) & self.bsdf().greater(Lanes::ZERO))
    }

    /// Reflection: the boundary, the clearcoat, diffuse light and sheen.
    #[inline(always)]
    fn reflection(
        &self,
        (wi, wo, m): (Lanes3<N>, Lanes3<N>, Lanes3<N>),
        (reflectance, possible): (Lanes<N>, Mask<N>),
        chance: &Probabilities<N>,
    ) -> Evals<N> {
        let (zero, one) = (Lanes::ZERO, Lanes::ONE);
        let front = wi.z.greater(zero);
        let (cos_i, cos_o) = (wi.dot(m), wo.dot(m));
        let change = Lanes::splat(0.25) / cos_o.abs();
        let visible = self.facets.visible_pdf(wi, m) * change;
        let inside = Lanes3::grey(self.bsdf() * reflectance);
        let color = front.select3(self.front_reflectance(cos_i, reflectance), inside);
        let boundary = Evals { value: color * (visible * self.facets.g1(wo, m)), pdf: chance.reflect * visible };
        let mut sum = boundary.only(possible);
        let coated = possible & front & self.clearcoat.greater(zero);
        if coated.any() {
            let fresnel = terms::schlick(Lanes3::grey(Lanes::splat(0.04)), cos_i, self.eta);
            let facets = self.coat().d(m) * Clearcoat::g(wi, wo, m);
            let value = fresnel * (Lanes::splat(0.25) * self.clearcoat * facets * wo.z);
            let coat = Evals { value, pdf: chance.coat * self.coat().pdf(m) * change }.only(coated);
            sum = Evals { value: sum.value + coat.value, pdf: sum.pdf + coat.pdf };
        }
        let diffuse = terms::diffuse([wi.z, wo.z, cos_o], self.roughness, self.flatness);
        let sheen = terms::sheen(self.base, (self.sheen, self.sheen_tint), cos_o);
        let value = (self.base * (self.brdf() * diffuse) + sheen * (one - self.metallic)) * wo.z;
        let base = Evals { value, pdf: chance.diffuse * warp::cosine_hemisphere_pdfs(wo.z) };
        let base = base.only(front & self.brdf().greater(zero));
        Evals { value: sum.value + base.value, pdf: sum.pdf + base.pdf }
    }
}

impl<const N: usize> Lobes<N> for Principled<N> {
    #[inline(always)]
    fn eval(&self, wi: Lanes3<N>, wo: Lanes3<N>) -> Evals<N> {
        let (zero, one) = (Lanes::ZERO, Lanes::ONE);
        let cosines = wi.z * wo.z;
        let (front, reflects) = (wi.z.greater(zero), cosines.greater(zero));
        let eta = fresnel::eta_across(wi.z, self.eta);
        let m = (wi + wo * reflects.select(one, eta)).normalize_or(Lanes3::ZERO);
        let m = m * one.copysign(m.z);
        let (cos_i, cos_o) = (wi.dot(m), wo.dot(m));
        let reflectance = fresnel::dielectric(cos_i, self.eta).reflectance;
        let chance = self.probabilities(front, reflectance);
        let possible = terms::same_side(m, wi, wo, reflects);
        let mut evals = Evals::ZERO;
        if reflects.any() {
            evals = self.reflection((wi, wo, m), (reflectance, possible), &chance).only(reflects);
        }
        let refracts = possible & cosines.less(zero) & self.bsdf().greater(zero);
        if refracts.any() {
            let both = cos_i + eta * cos_o;
            let visible = self.facets.visible_pdf(wi, m) * (eta * eta * cos_o.abs() / (both * both));
            let share = self.bsdf() * (one - reflectance) / (eta * eta);
            let color = self.base.map(|channel| channel.max(zero).sqrt());
            let value = color * (share * visible * self.facets.g1(wo, m));
            let pdf = chance.transmit * visible;
            evals = evals.replaced(&Evals { value, pdf }, refracts & pdf.finite());
        }
        evals.only(self.scatters(wi))
    }

    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N> {
        let (zero, one) = (Lanes::ZERO, Lanes::ONE);
        let front = wi.z.greater(zero);
        let (lobe, boundary) = (numbers.lobe, numbers.facet);
        let found = fresnel::dielectric(wi.dot(boundary), self.eta);
        let chance = self.probabilities(front, found.reflectance);
        let diffuse = lobe.less(chance.diffuse);
        let coat = !diffuse & lobe.less(chance.diffuse + chance.coat);
        let transmit = !(diffuse | coat) & lobe.less(chance.diffuse + chance.coat + chance.transmit);
        let m = if coat.any() { coat.select3(self.coat().sample(numbers.u), boundary) } else { boundary };
        let wo = transmit.select3(fresnel::refract_about(wi, m, &found), fresnel::reflect_about(wi, m));
        let wo = diffuse.select3(numbers.cosine, wo).normalize_or(Lanes3::ZERO);
        let cosines = wi.z * wo.z;
        let right_side = transmit.select(-cosines, cosines).greater(zero);
        let possible = right_side & (diffuse | terms::same_side(m, wi, wo, !transmit));
        (Scatters::towards(wo, transmit.select(one / found.eta_ti, one)), possible)
    }

    #[inline(always)]
    fn facets(&self, _lobe: Lanes<N>) -> Option<Facets<N>> {
        Some(self.facets.into())
    }
}
