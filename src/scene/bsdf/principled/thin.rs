//! The principled material for thin sheets: paper, leaves, bubbles. Both sides look the same.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::terms;
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel, warp};
use crate::scene::Surface;
use crate::scene::bsdf::microfacet::Microfacet;
use crate::scene::bsdf::{Bsdf, BsdfSample, Eval, mirror};
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::Texture;

/// `principledthin`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "principledthin",
    parameters: "base_color = 0.5, roughness = 0.5, anisotropic = 0, spec_trans = 0, eta = 1.5, spec_tint = 0, \
        sheen = 0, sheen_tint = 0, flatness = 0, diff_trans = 0 (to 2), specular_reflectance_sampling_rate, specular_transmittance_sampling_rate, \
        diffuse_reflectance_sampling_rate, diffuse_transmittance_sampling_rate (all four ignored)",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    object.ignore(&[
        "specular_reflectance_sampling_rate",
        "specular_transmittance_sampling_rate",
        "diffuse_reflectance_sampling_rate",
        "diffuse_transmittance_sampling_rate",
    ]);
    let mut number = |name: &str, default: f32| loader.texture(object, name, Rgb::splat(default));
    Ok(Arc::new(PrincipledThin {
        roughness: number("roughness", 0.5)?,
        anisotropic: number("anisotropic", 0.0)?,
        spec_trans: number("spec_trans", 0.0)?,
        eta: number("eta", 1.5)?,
        spec_tint: number("spec_tint", 0.0)?,
        sheen: number("sheen", 0.0)?,
        sheen_tint: number("sheen_tint", 0.0)?,
        flatness: number("flatness", 0.0)?,
        diff_trans: number("diff_trans", 0.0)?,
        base_color: loader.texture(object, "base_color", Rgb::splat(0.5))?,
    }))
}

struct PrincipledThin {
    base_color: Arc<dyn Texture>,
    roughness: Arc<dyn Texture>,
    anisotropic: Arc<dyn Texture>,
    spec_trans: Arc<dyn Texture>,
    eta: Arc<dyn Texture>,
    spec_tint: Arc<dyn Texture>,
    sheen: Arc<dyn Texture>,
    sheen_tint: Arc<dyn Texture>,
    flatness: Arc<dyn Texture>,
    diff_trans: Arc<dyn Texture>,
}

/// The parameters that sampling depends on, at a surface point.
struct Local {
    /// Share of the specular lobes, of which either is sampled half the time.
    specular: f32,
    diffuse_reflect: f32,
    diffuse_transmit: f32,
    roughness: f32,
    eta: f32,
    reflecting: Microfacet,
    /// Narrowed by passing both boundaries.
    transmitting: Microfacet,
}

impl PrincipledThin {
    fn local(&self, surface: &Surface) -> Local {
        let at = |texture: &Arc<dyn Texture>| texture.scalar(&surface.at);
        let (roughness, anisotropic, eta) = (at(&self.roughness), at(&self.anisotropic), at(&self.eta));
        let (specular, transmitted) = (at(&self.spec_trans), 0.5 * at(&self.diff_trans));
        Local {
            specular,
            diffuse_reflect: (1.0 - specular) * (1.0 - transmitted),
            diffuse_transmit: (1.0 - specular) * transmitted,
            roughness,
            eta,
            reflecting: terms::facets(roughness, anisotropic),
            transmitting: terms::facets((0.65 * eta - 0.35) * roughness, anisotropic),
        }
    }
}

impl Bsdf for PrincipledThin {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wi.z == 0.0 {
            return None;
        }
        let local = self.local(surface);
        let side = wi.z.signum();
        let from = wi * side;
        let lobe = lobe * (local.specular + local.diffuse_reflect + local.diffuse_transmit);
        let wo = if lobe < local.specular {
            let reflects = lobe < 0.5 * local.specular;
            let facets = if reflects { &local.reflecting } else { &local.transmitting };
            let m = facets.sample_visible(from, u);
            let above = fresnel::reflect_about(from, m);
            let wo = if reflects { above } else { mirror(above) };
            if above.z <= 0.0 || !terms::same_side(m, from, wo, reflects) {
                return None;
            }
            wo
        } else if lobe < local.specular + local.diffuse_reflect {
            warp::cosine_hemisphere(u)
        } else {
            -warp::cosine_hemisphere(u)
        };
        let wo = wo.normalize() * side;
        self.eval(surface, wi, wo).sampled(wo)
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z * wo.z == 0.0 {
            return Eval::default();
        }
        let local = self.local(surface);
        let side = wi.z.signum();
        let (wi, wo) = (wi * side, wo * side);
        let reflects = wo.z > 0.0;
        let above = if reflects { wo } else { mirror(wo) };
        let m = (wi + above).normalize();
        let base = self.base_color.color(&surface.at);
        let at = |texture: &Arc<dyn Texture>| texture.scalar(&surface.at);
        let mut sum = Eval::default();
        if local.specular > 0.0 && terms::same_side(m, wi, wo, reflects) {
            let cos = wi.dot(m);
            let dielectric = fresnel::dielectric(cos, local.eta).reflectance;
            let (facets, color) = if reflects {
                let tinted = terms::tint(base) * terms::schlick_r0(local.eta);
                let tinted = terms::schlick(tinted, cos, local.eta);
                (&local.reflecting, Rgb::splat(dielectric).lerp(tinted, at(&self.spec_tint)))
            } else {
                (&local.transmitting, base * (1.0 - dielectric))
            };
            let pdf = facets.reflect_pdf(wi, m);
            sum.value += color * (local.specular * pdf * facets.g1(wo, m));
            sum.pdf += 0.5 * local.specular * pdf;
        }
        let cosine = warp::cosine_hemisphere_pdf(above.z);
        if reflects && local.diffuse_reflect > 0.0 {
            let cos_d = m.dot(wo);
            let diffuse = terms::diffuse(wi.z, wo.z, cos_d, local.roughness, at(&self.flatness));
            let sheen = terms::sheen(base, at(&self.sheen), at(&self.sheen_tint), cos_d);
            sum.value += (base * diffuse + sheen) * (local.diffuse_reflect * wo.z);
            sum.pdf += local.diffuse_reflect * cosine;
        }
        if !reflects && local.diffuse_transmit > 0.0 {
            sum.value += base * (local.diffuse_transmit * FRAC_1_PI * above.z);
            sum.pdf += local.diffuse_transmit * cosine;
        }
        let total = local.specular + local.diffuse_reflect + local.diffuse_transmit;
        Eval { value: sum.value, pdf: sum.pdf / total }
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        let local = self.local(surface);
        if local.specular > 0.0 {
            return Some(local.reflecting.smallest().min(local.transmitting.smallest()));
        }
        Some(f32::INFINITY)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.base_color.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        true
    }

    fn needs_derivatives(&self) -> bool {
        self.anisotropic.constant() != Some(Rgb::ZERO)
    }
}
