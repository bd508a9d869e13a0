//! The terms that the principled materials are made of (Burley 2012 and 2015).

use std::f32::consts::FRAC_1_PI;

use super::facets::Ggx;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::math::luminance_weights;

/// (1 - cos θ)⁵.
#[inline(always)]
pub fn schlick_weight<const N: usize>(cos: Lanes<N>) -> Lanes<N> {
    let m = (Lanes::ONE - cos).max(Lanes::ZERO).min(Lanes::ONE);
    (m * m) * (m * m) * m
}

/// Schlick's reflectance at the cosine to a facet, for relative index `eta`; towards the thinner medium the angle is
/// that of the refracted direction.
#[inline(always)]
pub fn schlick<const N: usize>(r0: Lanes3<N>, cos: Lanes<N>, eta: Lanes<N>) -> Lanes3<N> {
    let one = Lanes::ONE;
    let inside = cos.less(Lanes::ZERO);
    let (eta_it, eta_ti) = (inside.select(one / eta, eta), inside.select(eta, one / eta));
    let refracted = (one - (one - cos * cos) * eta_ti * eta_ti).max(Lanes::ZERO).sqrt();
    let weight = schlick_weight(eta_it.greater(one).select(cos.abs(), refracted));
    r0.lerp(Lanes3::ONE, weight)
}

/// Reflectance at normal incidence.
#[inline(always)]
pub fn schlick_r0<const N: usize>(eta: Lanes<N>) -> Lanes<N> {
    let root = (eta - Lanes::ONE) / (eta + Lanes::ONE);
    root * root
}

/// The colour at luminance one; white for black.
#[inline(always)]
pub fn tint<const N: usize>(color: Lanes3<N>) -> Lanes3<N> {
    let luminance = color.dot(Lanes3::splat(luminance_weights()));
    luminance.greater(Lanes::ZERO).select3(color * (Lanes::ONE / luminance), Lanes3::ONE)
}

/// Lanes in which a facet `m` (m.z > 0) shows the same side to both directions as the surface does.
#[inline(always)]
pub fn same_side<const N: usize>(m: Lanes3<N>, wi: Lanes3<N>, wo: Lanes3<N>, reflects: Mask<N>) -> Mask<N> {
    let m = m * Lanes::ONE.copysign(wi.z);
    let towards_wo = reflects.select3(m, -m);
    wi.dot(m).greater(Lanes::ZERO) & wo.dot(towards_wo).greater(Lanes::ZERO)
}

/// Diffuse reflection with retro-reflection, flattened towards subsurface scattering, over albedo and without the
/// cosine. `cos_d` is the cosine between a direction and the half vector.
#[inline(always)]
pub fn diffuse<const N: usize>(
    [cos_i, cos_o, cos_d]: [Lanes<N>; 3],
    roughness: Lanes<N>,
    flatness: Lanes<N>,
) -> Lanes<N> {
    let (one, half, two) = (Lanes::ONE, Lanes::splat(0.5), Lanes::splat(2.0));
    let (cos_i, cos_o) = (cos_i.abs(), cos_o.abs());
    let (fi, fo) = (schlick_weight(cos_i), schlick_weight(cos_o));
    let retro = two * roughness * cos_d * cos_d;
    let plain = (one - half * fi) * (one - half * fo) + retro * (fo + fi + fo * fi * (retro - one));
    let mix = |weight: Lanes<N>| one + (half * retro - one) * weight;
    let flat = Lanes::splat(1.25) * (mix(fo) * mix(fi) * (one / (cos_o + cos_i) - half) + half);
    let mixed = flatness.greater(Lanes::ZERO).select(plain + (flat - plain) * flatness, plain);
    Lanes::splat(FRAC_1_PI) * mixed
}

/// The sheen of cloth, without the cosine.
#[inline(always)]
pub fn sheen<const N: usize>(base: Lanes3<N>, (sheen, sheen_tint): (Lanes<N>, Lanes<N>), cos_d: Lanes<N>) -> Lanes3<N> {
    Lanes3::ONE.lerp(tint(base), sheen_tint) * (sheen * schlick_weight(cos_d.abs()))
}

/// The clearcoat's facets: a distribution with a longer tail than GGX (Berry's), isotropic.
#[derive(Clone, Copy)]
pub struct Clearcoat<const N: usize> {
    pub alpha: Lanes<N>,
}

impl<const N: usize> Clearcoat<N> {
    /// Density of normals.
    #[inline(always)]
    pub fn d(self, m: Lanes3<N>) -> Lanes<N> {
        let one = Lanes::ONE;
        let a2 = self.alpha * self.alpha;
        let value = (a2 - one) * Lanes::splat(FRAC_1_PI) / (a2.ln() * (one + (a2 - one) * m.z * m.z));
        (value * m.z).greater(Lanes::splat(1e-20)).select(value, Lanes::ZERO)
    }

    /// Density of [`Clearcoat::sample`].
    #[inline(always)]
    pub fn pdf(self, m: Lanes3<N>) -> Lanes<N> {
        self.d(m) * m.z.max(Lanes::ZERO)
    }

    /// A normal.
    #[inline(always)]
    pub fn sample(self, [u, v]: [Lanes<N>; 2]) -> Lanes3<N> {
        let one = Lanes::ONE;
        let a2 = self.alpha * self.alpha;
        let power = ((one - v) * a2.ln()).exp_negative();
        let cos2 = ((one - power) / (one - a2)).max(Lanes::ZERO).min(one);
        let (cos_phi, sin_phi) = u.cos_sin_turns();
        let across = (one - cos2).sqrt();
        Lanes3 { x: cos_phi * across, y: sin_phi * across, z: cos2.sqrt() }
    }

    /// Masking, with a roughness of its own.
    #[inline(always)]
    pub fn g(wi: Lanes3<N>, wo: Lanes3<N>, m: Lanes3<N>) -> Lanes<N> {
        let facets = Ggx { alpha: [Lanes::splat(0.25); 2] };
        facets.g1(wi, m) * facets.g1(wo, m)
    }
}
