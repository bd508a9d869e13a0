//! Rough glass: a microfacet boundary between two transparent media (Walter et al. 2007).

use std::sync::Arc;

use super::ior::{BK7, relative_ior};
use super::microfacet::Roughness;
use super::{Bsdf, Whole};
use crate::error::Result;
use crate::math::Rgb;
use crate::math::lanes::{Lanes, Lanes3};
use crate::scene::Surface;
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `roughdielectric`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "roughdielectric",
    parameters: "int_ior = bk7, ext_ior = air, specular_reflectance = 1, specular_transmittance = 1, \
        alpha = 0.1 or alpha_u and alpha_v, distribution = beckmann (ggx), sample_visible (ignored)",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
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
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let [reflectance, transmittance] =
            [&self.reflectance, &self.transmittance].map(|factor| Lanes3::splat(factor.color(at)));
        let (eta, facets) = (Lanes([self.eta]), self.roughness.at(at));
        let roughness = Some(facets.smallest());
        let facets = facets.facets();
        Some(closure::RoughDielectric { eta, reflectance, transmittance, facets }.closure(roughness))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        self.roughness.textures().chain([&*self.reflectance, &*self.transmittance]).collect()
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
