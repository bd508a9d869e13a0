//! Rough glass: a microfacet boundary between two transparent media (Walter et al. 2007).

use std::sync::Arc;

use super::microfacet::Roughness;
use super::{BK7, Bsdf, BsdfSample, Eval, Lobe, relative_ior};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::Texture;

/// `roughdielectric`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "roughdielectric",
    parameters: "int_ior = bk7, ext_ior = air, specular_reflectance = 1, specular_transmittance = 1, \
        alpha = 0.1 or alpha_u and alpha_v, distribution = beckmann (ggx), sample_visible (ignored)",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    let eta = relative_ior(object, BK7)?;
    if (eta - 1.0).abs() < 1e-4 {
        return Err(object.loc_of("int_ior").unsupported("a rough boundary between equal indices of refraction"));
    }
    Ok(Arc::new(RoughDielectric {
        eta,
        roughness: Roughness::load(object, loader)?,
        reflectance: loader.texture(object, "specular_reflectance", Rgb::ONE)?,
        transmittance: loader.texture(object, "specular_transmittance", Rgb::ONE)?,
    }))
}

struct RoughDielectric {
    eta: f32,
    roughness: Roughness,
    reflectance: Arc<dyn Texture>,
    transmittance: Arc<dyn Texture>,
}

impl Bsdf for RoughDielectric {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wi.z == 0.0 {
            return None;
        }
        let m = self.roughness.at(surface).sample_visible(wi * wi.z.signum(), u);
        let found = fresnel::dielectric(wi.dot(m), self.eta);
        let reflects = lobe < found.reflectance;
        let wo = if reflects {
            fresnel::reflect_about(wi, m)
        } else {
            fresnel::refract_about(wi, m, found.cos_t, found.eta_ti)
        };
        let wo = wo.normalize();
        // Facets may send light to the side it does not belong to.
        if reflects != (wi.z * wo.z > 0.0) {
            return None;
        }
        let Eval { value, pdf } = self.eval(surface, wi, wo);
        let eta = if reflects { 1.0 } else { 1.0 / found.eta_ti };
        (pdf > 0.0).then(|| BsdfSample { wo, weight: value / pdf, pdf, lobe: Lobe::Smooth, eta })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z * wo.z == 0.0 {
            return Eval::default();
        }
        let reflects = wi.z * wo.z > 0.0;
        // Index of refraction of the side the light goes to over that of the side it comes from.
        let eta = if wi.z > 0.0 { self.eta } else { 1.0 / self.eta };
        let Some(m) = (wi + wo * if reflects { 1.0 } else { eta }).try_normalize() else { return Eval::default() };
        let m = m * 1f32.copysign(m.z);
        let (cos_i, cos_o) = (wi.dot(m), wo.dot(m));
        // A facet shows both directions the side that the surface shows them, or nothing is scattered.
        if cos_i * wi.z <= 0.0 || cos_o * wo.z <= 0.0 {
            return Eval::default();
        }
        let facets = self.roughness.at(surface);
        let reflectance = fresnel::dielectric(cos_i, self.eta).reflectance;
        let visible = facets.visible_pdf(wi, m);
        let (tint, share, change, squeeze) = if reflects {
            (&self.reflectance, reflectance, 0.25 / cos_o.abs(), 1.0)
        } else {
            // Solid angle of normal per solid angle of direction, eq. 17; and the cone that radiance is squeezed into.
            let sum = cos_i + eta * cos_o;
            (&self.transmittance, 1.0 - reflectance, eta * eta * cos_o.abs() / (sum * sum), 1.0 / (eta * eta))
        };
        let pdf = share * visible * change;
        if pdf <= 0.0 || !pdf.is_finite() {
            return Eval::default();
        }
        Eval { value: tint.color(&surface.at) * (pdf * facets.g1(wo, m) * squeeze), pdf }
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        Some(self.roughness.at(surface).smallest())
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.transmittance.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        true
    }

    fn refraction(&self) -> Option<f32> {
        Some(self.eta)
    }

    fn needs_derivatives(&self) -> bool {
        self.roughness.is_anisotropic()
    }
}
