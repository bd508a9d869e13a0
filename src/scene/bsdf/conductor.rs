//! Smooth metal, on the outside only.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe, ior, metals};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel, vec3};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::Texture;

/// `conductor`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> =
    Plugin { name: "conductor", parameters: "material = none, eta, k, ext_eta = 1, specular_reflectance = 1", make };

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(Conductor { metal: Metal::load(object, loader)? }))
}

/// Complex index of refraction and a factor on the reflectance.
pub struct Metal {
    eta: Rgb,
    k: Rgb,
    reflectance: Arc<dyn Texture>,
}

impl Metal {
    /// From `material`, or from `eta` and `k`.
    pub fn load(object: &Object, loader: &mut Loader) -> Result<Self> {
        let names = metals::names();
        let (eta, k) = metals::index_of_refraction(object.choice("material", &names, metals::NONE)?);
        let (eta, k) = (object.index("eta", eta)?, object.index("k", k)?);
        // Indices are relative to what surrounds the metal.
        let outside = ior(object, "ext_eta", 1.0)?;
        let (eta, k) = (eta / outside, k / outside);
        Ok(Self { eta, k, reflectance: loader.texture(object, "specular_reflectance", Rgb::ONE)? })
    }

    /// Reflectance at a cosine.
    pub fn reflectance(&self, surface: &Surface, cos: f32) -> Rgb {
        fresnel::conductor(cos, self.eta, self.k) * self.reflectance.color(&surface.at)
    }
}

struct Conductor {
    metal: Metal,
}

impl Bsdf for Conductor {
    fn sample(&self, surface: &Surface, wi: Vec3, _lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let Delta { wo, value, .. } = self.delta(surface, wi, Lobe::DeltaReflect)?;
        Some(BsdfSample { wo, weight: value, pdf: 1.0, lobe: Lobe::DeltaReflect, eta: 1.0 })
    }

    fn eval(&self, _surface: &Surface, _wi: Vec3, _wo: Vec3) -> Eval {
        Eval::default()
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let happens = wi.z > 0.0 && lobe == Lobe::DeltaReflect;
        happens.then(|| Delta {
            wo: fresnel::reflect(wi),
            value: self.metal.reflectance(surface, wi.z),
            probability: 1.0,
        })
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        None
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.metal.reflectance(surface, 1.0).clamp(vec3(0.0, 0.0, 0.0), Rgb::ONE)
    }
}
