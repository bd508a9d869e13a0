//! Plastic as polarising renderers have it (Baek et al. 2018), for unpolarised light: rough specular reflection and diffuse
//! light that is refracted in and out once.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::ior::{POLYPROPYLENE, relative_ior};
use super::microfacet::{Kind, Microfacet};
use super::{Bsdf, BsdfSample, Eval, are_above, specular_or_diffuse, specular_share};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel, vec2, warp};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::Texture;

/// `pplastic`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "pplastic",
    parameters: "int_ior = polypropylene, ext_ior = air, diffuse_reflectance = 0.5, specular_reflectance = 1, \
        alpha = 0.1 or alpha_u and alpha_v, distribution = beckmann (ggx), sample_visible (ignored)",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    object.ignore(&["sample_visible"]);
    let alpha = object.float("alpha", 0.1)?;
    let alpha = vec2(object.float("alpha_u", alpha)?, object.float("alpha_v", alpha)?);
    let diffuse = loader.texture(object, "diffuse_reflectance", Rgb::splat(0.5))?;
    let specular = loader.texture(object, "specular_reflectance", Rgb::ONE)?;
    let specular_share = specular_share(&*diffuse, &*specular);
    let facets = Microfacet::anisotropic(Kind::load(object, loader)?, alpha);
    Ok(Arc::new(Pplastic { eta: relative_ior(object, POLYPROPYLENE)?, facets, diffuse, specular, specular_share }))
}

struct Pplastic {
    eta: f32,
    facets: Microfacet,
    diffuse: Arc<dyn Texture>,
    specular: Arc<dyn Texture>,
    specular_share: f32,
}

impl Bsdf for Pplastic {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let visible = || fresnel::reflect_about(wi, self.facets.sample_visible(wi, u));
        let wo = specular_or_diffuse(wi, (lobe, self.specular_share), u, visible)?;
        self.eval(surface, wi, wo).sampled(wo)
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if !are_above(wi, wo) {
            return Eval::default();
        }
        let reflectance = |cos: f32| fresnel::dielectric(cos, self.eta).reflectance;
        let m = (wi + wo).normalize();
        let reflected = self.facets.reflect_pdf(wi, m);
        let specular = reflectance(wi.dot(m)) * reflected * self.facets.g1(wo, m);
        let diffuse = (1.0 - reflectance(wi.z)) * (1.0 - reflectance(wo.z)) * FRAC_1_PI * wo.z;
        let share = self.specular_share;
        Eval {
            value: self.specular.color(&surface.at) * specular + self.diffuse.color(&surface.at) * diffuse,
            pdf: share * reflected + (1.0 - share) * warp::cosine_hemisphere_pdf(wo.z),
        }
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        Some(self.facets.smallest())
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.diffuse.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn needs_derivatives(&self) -> bool {
        self.facets.alpha.x != self.facets.alpha.y
    }
}
