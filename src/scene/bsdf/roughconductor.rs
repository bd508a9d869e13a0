//! Rough metal: a microfacet surface of perfect mirrors, on the outside only.

use std::sync::Arc;

use super::conductor::Metal;
use super::microfacet::Roughness;
use super::{Bsdf, Whole};
use crate::error::Result;
use crate::math::Rgb;
use crate::scene::Surface;
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `roughconductor`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "roughconductor",
    parameters: "material = none, eta, k, ext_eta = 1, specular_reflectance = 1, alpha = 0.1 or alpha_u and alpha_v, \
        distribution = beckmann (ggx), sample_visible (ignored)",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(RoughConductor { metal: Metal::load(object, loader)?, roughness: Roughness::load(object, loader)? }))
}

struct RoughConductor {
    metal: Metal,
    roughness: Roughness,
}

impl Bsdf for RoughConductor {
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let [eta, k, tint] = self.metal.at(at);
        let facets = self.roughness.at(at);
        let roughness = Some(facets.smallest());
        Some(closure::RoughConductor { eta, k, tint, facets: facets.facets() }.closure(roughness))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        self.roughness.textures().chain([self.metal.texture()]).collect()
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.metal.albedo(surface)
    }

    fn needs_derivatives(&self) -> bool {
        self.roughness.is_anisotropic()
    }
}
