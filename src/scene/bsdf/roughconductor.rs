//! Rough metal: a microfacet surface of perfect mirrors, on the outside only.

use std::sync::Arc;

use super::conductor::Metal;
use super::microfacet::Roughness;
use super::{Bsdf, BsdfSample, Eval, Lobe};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};

/// `roughconductor`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "roughconductor",
    parameters: "material = none, eta, k, ext_eta = 1, specular_reflectance = 1, alpha = 0.1 or alpha_u and alpha_v, \
        distribution = beckmann (ggx), sample_visible (ignored)",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(RoughConductor { metal: Metal::load(object, loader)?, roughness: Roughness::load(object, loader)? }))
}

struct RoughConductor {
    metal: Metal,
    roughness: Roughness,
}

impl Bsdf for RoughConductor {
    fn sample(&self, surface: &Surface, wi: Vec3, _lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wi.z <= 0.0 {
            return None;
        }
        let facets = self.roughness.at(surface);
        let m = facets.sample_visible(wi, u);
        let wo = fresnel::reflect_about(wi, m);
        let pdf = facets.reflect_pdf(wi, m);
        if wo.z <= 0.0 || pdf <= 0.0 {
            return None;
        }
        let weight = self.metal.reflectance(surface, wi.dot(m)) * facets.g1(wo, m);
        Some(BsdfSample { wo, weight, pdf, lobe: Lobe::Smooth, eta: 1.0 })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Eval::default();
        }
        let facets = self.roughness.at(surface);
        let m = (wi + wo).normalize();
        let pdf = facets.reflect_pdf(wi, m);
        Eval { value: self.metal.reflectance(surface, wi.dot(m)) * (pdf * facets.g1(wo, m)), pdf }
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        Some(self.roughness.at(surface).smallest())
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.metal.reflectance(surface, 1.0).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn needs_derivatives(&self) -> bool {
        self.roughness.is_anisotropic()
    }
}
