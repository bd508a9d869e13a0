//! Rough plastic: a rough dielectric coat over a diffuse base.

use std::sync::Arc;

use super::microfacet::{Kind, Microfacet, RoughTransmittance};
use super::plastic::Base;
use super::{Bsdf, BsdfSample, Eval, POLYPROPYLENE, relative_ior};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel, warp};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};

/// `roughplastic`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "roughplastic",
    parameters: "int_ior = polypropylene, ext_ior = air, diffuse_reflectance = 0.5, specular_reflectance = 1, \
        nonlinear = false, alpha = 0.1, distribution = beckmann (ggx), sample_visible (ignored)",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    // Visible normals are always sampled.
    object.ignore(&["sample_visible"]);
    let eta = relative_ior(object, POLYPROPYLENE)?;
    if eta <= 1.0 {
        return Err(object.loc.unsupported("roughplastic with an interior no denser than its exterior"));
    }
    let facets = Microfacet::new(Kind::load(object, loader)?, object.float("alpha", 0.1)?);
    let transmittance = RoughTransmittance::new(facets, eta);
    let base = Base::load(object, loader, eta, transmittance.internal)?;
    Ok(Arc::new(RoughPlastic { eta, facets, transmittance, base }))
}

struct RoughPlastic {
    eta: f32,
    facets: Microfacet,
    transmittance: RoughTransmittance,
    base: Base,
}

impl Bsdf for RoughPlastic {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wi.z <= 0.0 {
            return None;
        }
        let coat = self.base.coat_probability(1.0 - self.transmittance.at(wi.z));
        let wo = if lobe < coat {
            fresnel::reflect_about(wi, self.facets.sample_visible(wi, u))
        } else {
            warp::cosine_hemisphere(u)
        };
        self.eval(surface, wi, wo).sampled(wo)
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Eval::default();
        }
        let m = (wi + wo).normalize();
        let reflected = self.facets.reflect_pdf(wi, m);
        let reflectance = fresnel::dielectric(wi.dot(m), self.eta).reflectance;
        let specular = self.base.specular(surface) * (reflectance * reflected * self.facets.g1(wo, m));
        let ti = self.transmittance.at(wi.z);
        let diffuse = self.base.value(surface, wo.z, ti * self.transmittance.at(wo.z));
        let coat = self.base.coat_probability(1.0 - ti);
        let pdf = coat * reflected + (1.0 - coat) * warp::cosine_hemisphere_pdf(wo.z);
        Eval { value: specular + diffuse, pdf }
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        Some(self.facets.smallest())
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.base.albedo(surface)
    }
}
