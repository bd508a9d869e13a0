//! The principled material: diffuse, metal, rough glass, clearcoat and sheen in one (Burley 2012 and 2015).

mod terms;
pub mod thin;

use std::sync::Arc;

use self::terms::Clearcoat;
use super::microfacet::Microfacet;
use super::{Bsdf, BsdfSample, Eval, Lobe};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel, warp};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::Texture;

/// `principled`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "principled",
    parameters: "base_color = 0.5, roughness = 0.5, anisotropic = 0, metallic = 0, spec_trans = 0, \
        eta or specular = 0.5, spec_tint = 0, sheen = 0, sheen_tint = 0, flatness = 0, clearcoat = 0, \
        clearcoat_gloss = 0, main_specular_sampling_rate, clearcoat_sampling_rate, \
        diffuse_reflectance_sampling_rate (all three ignored)",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    object.ignore(&["main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate"]);
    let eta = relative_ior(object)?;
    let mut number = |name: &str, default: f32| loader.texture(object, name, Rgb::splat(default));
    Ok(Arc::new(Principled {
        eta,
        roughness: number("roughness", 0.5)?,
        anisotropic: number("anisotropic", 0.0)?,
        metallic: number("metallic", 0.0)?,
        spec_trans: number("spec_trans", 0.0)?,
        spec_tint: number("spec_tint", 0.0)?,
        sheen: number("sheen", 0.0)?,
        sheen_tint: number("sheen_tint", 0.0)?,
        flatness: number("flatness", 0.0)?,
        clearcoat: number("clearcoat", 0.0)?,
        clearcoat_gloss: number("clearcoat_gloss", 0.0)?,
        base_color: loader.texture(object, "base_color", Rgb::splat(0.5))?,
    }))
}

/// From `eta`, or from `specular`, which spans the reflectance of common dielectrics. Equal indices would leave nothing to
/// refract by, so the index is kept off one.
fn relative_ior(object: &Object) -> Result<f32> {
    if object.get("eta").is_some() && object.get("specular").is_some() {
        return Err(object.loc_of("eta").invalid("give either `eta` or `specular`"));
    }
    let specular = object.float("specular", 0.5)?;
    let from_specular = 2.0 / (1.0 - (0.08 * specular.max(1e-3)).sqrt()) - 1.0;
    let eta = object.float("eta", from_specular)?;
    if !(eta > 0.0 && eta.is_finite()) {
        return Err(object.loc_of("eta").invalid("`eta` must be positive"));
    }
    Ok(if eta == 1.0 { 1.001 } else { eta })
}

struct Principled {
    eta: f32,
    base_color: Arc<dyn Texture>,
    roughness: Arc<dyn Texture>,
    anisotropic: Arc<dyn Texture>,
    metallic: Arc<dyn Texture>,
    spec_trans: Arc<dyn Texture>,
    spec_tint: Arc<dyn Texture>,
    sheen: Arc<dyn Texture>,
    sheen_tint: Arc<dyn Texture>,
    flatness: Arc<dyn Texture>,
    clearcoat: Arc<dyn Texture>,
    clearcoat_gloss: Arc<dyn Texture>,
}

/// The parameters that sampling depends on, at a surface point.
struct Local {
    metallic: f32,
    /// Share of the opaque dielectric.
    brdf: f32,
    /// Share of the transparent dielectric.
    bsdf: f32,
    clearcoat: f32,
    coat: Clearcoat,
    facets: Microfacet,
}

/// How often each lobe is sampled; they sum to one.
struct Probabilities {
    reflect: f32,
    transmit: f32,
    coat: f32,
    diffuse: f32,
}

impl Principled {
    fn local(&self, surface: &Surface) -> Local {
        let at = |texture: &Arc<dyn Texture>| texture.scalar(&surface.at);
        let (metallic, spec_trans) = (at(&self.metallic), at(&self.spec_trans));
        Local {
            metallic,
            brdf: (1.0 - metallic) * (1.0 - spec_trans),
            bsdf: (1.0 - metallic) * spec_trans,
            clearcoat: at(&self.clearcoat),
            coat: Clearcoat::new(at(&self.clearcoat_gloss)),
            facets: terms::facets(at(&self.roughness), at(&self.anisotropic)),
        }
    }

    /// Reflectance of a facet from the front: metal and tinted specular by Schlick, the rest by Fresnel.
    fn front_reflectance(&self, surface: &Surface, base: Rgb, metallic: f32, cos: f32, dielectric: f32) -> Rgb {
        let spec_tint = self.spec_tint.scalar(&surface.at);
        let eta_it = if cos >= 0.0 { self.eta } else { 1.0 / self.eta };
        let tinted = terms::tint(base) * terms::schlick_r0(eta_it);
        terms::schlick(base, cos, self.eta) * metallic
            + terms::schlick(tinted, cos, self.eta) * ((1.0 - metallic) * spec_tint)
            + Rgb::splat((1.0 - metallic) * (1.0 - spec_tint) * dielectric)
    }
}

impl Local {
    fn probabilities(&self, front: bool, reflectance: f32) -> Probabilities {
        let transmitted = 1.0 - reflectance;
        let (reflect, transmit, coat, diffuse) = if front {
            (1.0 - self.bsdf * transmitted, self.bsdf * transmitted, 0.25 * self.clearcoat, self.brdf)
        } else {
            // Inside, there are only the boundary's two ways.
            (reflectance, transmitted, 0.0, 0.0)
        };
        let total = reflect + transmit + coat + diffuse;
        Probabilities {
            reflect: reflect / total,
            transmit: transmit / total,
            coat: coat / total,
            diffuse: diffuse / total,
        }
    }
}

impl Bsdf for Principled {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let local = self.local(surface);
        let front = wi.z > 0.0;
        if wi.z == 0.0 || !(front || local.bsdf > 0.0) {
            return None;
        }
        let m = local.facets.sample_visible(wi * wi.z.signum(), u);
        let found = fresnel::dielectric(wi.dot(m), self.eta);
        let chance = local.probabilities(front, found.reflectance);
        let (wo, m, reflects) = if lobe < chance.diffuse {
            (warp::cosine_hemisphere(u), None, true)
        } else if lobe < chance.diffuse + chance.coat {
            let m = local.coat.sample(u);
            (fresnel::reflect_about(wi, m), Some(m), true)
        } else if lobe < chance.diffuse + chance.coat + chance.transmit {
            (fresnel::refract_about(wi, m, found.cos_t, found.eta_ti), Some(m), false)
        } else {
            (fresnel::reflect_about(wi, m), Some(m), true)
        };
        let wo = wo.normalize();
        let possible = m.is_none_or(|m| terms::same_side(m, wi, wo, reflects));
        if !possible || reflects != (wi.z * wo.z > 0.0) {
            return None;
        }
        let Eval { value, pdf } = self.eval(surface, wi, wo);
        let eta = if reflects { 1.0 } else { 1.0 / found.eta_ti };
        (pdf > 0.0).then(|| BsdfSample { wo, weight: value / pdf, pdf, lobe: Lobe::Smooth, eta })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        let local = self.local(surface);
        let (front, reflects) = (wi.z > 0.0, wi.z * wo.z > 0.0);
        if wi.z * wo.z == 0.0 || !(front || local.bsdf > 0.0) {
            return Eval::default();
        }
        let eta = if front { self.eta } else { 1.0 / self.eta };
        let Some(m) = (wi + wo * if reflects { 1.0 } else { eta }).try_normalize() else { return Eval::default() };
        let m = m * 1f32.copysign(m.z);
        let (cos_i, cos_o) = (wi.dot(m), wo.dot(m));
        let reflectance = fresnel::dielectric(cos_i, self.eta).reflectance;
        let chance = local.probabilities(front, reflectance);
        let possible = terms::same_side(m, wi, wo, reflects);
        let visible = local.facets.visible_pdf(wi, m);
        let base = self.base_color.color(&surface.at);
        let mut sum = Eval::default();
        if !reflects {
            if possible && local.bsdf > 0.0 {
                let both = cos_i + eta * cos_o;
                let change = eta * eta * cos_o.abs() / (both * both);
                sum.pdf = chance.transmit * visible * change;
                let share = local.bsdf * (1.0 - reflectance) / (eta * eta);
                sum.value = base.max(Rgb::ZERO).powf(0.5) * (share * visible * change * local.facets.g1(wo, m));
            }
            return if sum.pdf.is_finite() { sum } else { Eval::default() };
        }
        if possible {
            let change = 0.25 / cos_o.abs();
            let color = if front {
                self.front_reflectance(surface, base, local.metallic, cos_i, reflectance)
            } else {
                Rgb::splat(local.bsdf * reflectance)
            };
            sum.value += color * (visible * change * local.facets.g1(wo, m));
            sum.pdf += chance.reflect * visible * change;
            if front && local.clearcoat > 0.0 {
                let fresnel = terms::schlick(Rgb::splat(0.04), cos_i, self.eta);
                let facets = local.coat.d(m) * Clearcoat::g(wi, wo, m);
                sum.value += fresnel * (0.25 * local.clearcoat * facets * wo.z);
                sum.pdf += chance.coat * local.coat.pdf(m) * change;
            }
        }
        if front && local.brdf > 0.0 {
            let at = |texture: &Arc<dyn Texture>| texture.scalar(&surface.at);
            let diffuse = terms::diffuse(wi.z, wo.z, cos_o, at(&self.roughness), at(&self.flatness));
            let sheen = terms::sheen(base, at(&self.sheen), at(&self.sheen_tint), cos_o);
            sum.value += (base * (local.brdf * diffuse) + sheen * (1.0 - local.metallic)) * wo.z;
            sum.pdf += chance.diffuse * warp::cosine_hemisphere_pdf(wo.z);
        }
        sum
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        let local = self.local(surface);
        let coat = if local.clearcoat > 0.0 { local.coat.alpha } else { f32::INFINITY };
        Some(local.facets.smallest().min(coat))
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.base_color.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        self.spec_trans.constant() != Some(Rgb::ZERO)
    }

    fn refraction(&self) -> Option<f32> {
        self.transmits().then_some(self.eta)
    }

    fn needs_derivatives(&self) -> bool {
        self.anisotropic.constant() != Some(Rgb::ZERO)
    }
}
