//! The terms that the principled materials are made of (Burley 2012 and 2015).

use std::f32::consts::FRAC_1_PI;

use crate::math::{Rgb, Vec2, Vec3, luminance, vec2};
use crate::scene::bsdf::microfacet::{Kind, Microfacet};

/// (1 - cos θ)⁵.
pub fn schlick_weight(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    (m * m) * (m * m) * m
}

/// Schlick's reflectance at the cosine to a facet, for relative index `eta`; towards the thinner medium the angle is
/// that of the refracted direction.
pub fn schlick(r0: Rgb, cos: f32, eta: f32) -> Rgb {
    let (eta_it, eta_ti) = if cos >= 0.0 { (eta, 1.0 / eta) } else { (1.0 / eta, eta) };
    let refracted = (1.0 - (1.0 - cos * cos) * eta_ti * eta_ti).max(0.0).sqrt();
    let weight = schlick_weight(if eta_it > 1.0 { cos.abs() } else { refracted });
    r0.lerp(Rgb::ONE, weight)
}

/// Reflectance at normal incidence.
pub fn schlick_r0(eta: f32) -> f32 {
    let root = (eta - 1.0) / (eta + 1.0);
    root * root
}

/// The colour at luminance one; white for black.
pub fn tint(color: Rgb) -> Rgb {
    let luminance = luminance(color);
    if luminance > 0.0 { color / luminance } else { Rgb::ONE }
}

/// Facets of the main specular lobe.
pub fn facets(roughness: f32, anisotropic: f32) -> Microfacet {
    let squared = roughness * roughness;
    let aspect = (1.0 - 0.9 * anisotropic).sqrt();
    let alpha: Vec2 = vec2(squared / aspect, squared * aspect).max(Vec2::splat(1e-3));
    Microfacet::anisotropic(Kind::Ggx, alpha)
}

/// Whether a facet `m` (m.z > 0) shows the same side to both directions as the surface does.
pub fn same_side(m: Vec3, wi: Vec3, wo: Vec3, reflects: bool) -> bool {
    let m = m * 1f32.copysign(wi.z);
    let towards_wo = if reflects { m } else { -m };
    wi.dot(m) > 0.0 && wo.dot(towards_wo) > 0.0
}

/// Diffuse reflection with retro-reflection, flattened towards subsurface scattering, over albedo and without the
/// cosine. `cos_d` is the cosine between a direction and the half vector.
pub fn diffuse(cos_i: f32, cos_o: f32, cos_d: f32, roughness: f32, flatness: f32) -> f32 {
    let (fi, fo) = (schlick_weight(cos_i.abs()), schlick_weight(cos_o.abs()));
    let retro = 2.0 * roughness * cos_d * cos_d;
    let plain = (1.0 - 0.5 * fi) * (1.0 - 0.5 * fo) + retro * (fo + fi + fo * fi * (retro - 1.0));
    let mixed = if flatness == 0.0 {
        plain
    } else {
        let lerp = |weight: f32| 1.0 + (0.5 * retro - 1.0) * weight;
        let flat = 1.25 * (lerp(fo) * lerp(fi) * (1.0 / (cos_o.abs() + cos_i.abs()) - 0.5) + 0.5);
        plain + (flat - plain) * flatness
    };
    FRAC_1_PI * mixed
}

/// The sheen of cloth, without the cosine.
pub fn sheen(base: Rgb, sheen: f32, sheen_tint: f32, cos_d: f32) -> Rgb {
    Rgb::ONE.lerp(tint(base), sheen_tint) * (sheen * schlick_weight(cos_d.abs()))
}

/// The clearcoat's facets: a distribution with a longer tail than GGX (Berry's), isotropic.
#[derive(Clone, Copy)]
pub struct Clearcoat {
    pub alpha: f32,
}

impl Clearcoat {
    pub fn new(gloss: f32) -> Self {
        Self { alpha: 0.1 + (0.001 - 0.1) * gloss }
    }

    pub fn d(self, m: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        let value = (a2 - 1.0) * FRAC_1_PI / (a2.ln() * (1.0 + (a2 - 1.0) * m.z * m.z));
        if value * m.z > 1e-20 { value } else { 0.0 }
    }

    pub fn pdf(self, m: Vec3) -> f32 {
        self.d(m) * m.z.max(0.0)
    }

    pub fn sample(self, u: Vec2) -> Vec3 {
        let a2 = self.alpha * self.alpha;
        let cos2 = ((1.0 - a2.powf(1.0 - u.y)) / (1.0 - a2)).clamp(0.0, 1.0);
        let across = Vec2::from_angle(std::f32::consts::TAU * u.x) * (1.0 - cos2).sqrt();
        across.extend(cos2.sqrt())
    }

    /// Masking, with a roughness of its own.
    pub fn g(wi: Vec3, wo: Vec3, m: Vec3) -> f32 {
        let facets = Microfacet::new(Kind::Ggx, 0.25);
        facets.g1(wi, m) * facets.g1(wo, m)
    }
}
