//! Smooth metal, on the outside only.

use std::sync::Arc;

use super::ior::ior;
use super::{Bsdf, Whole, metals};
use crate::error::Result;
use crate::math::lanes::Lanes3;
use crate::math::{Rgb, fresnel};
use crate::scene::Surface;
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `conductor`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> =
    Plugin { name: "conductor", parameters: "material = none, eta, k, ext_eta = 1, specular_reflectance = 1", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
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
    pub fn load(object: &Object, loader: &mut dyn Loader) -> Result<Self> {
        let names = metals::names();
        let (eta, k) = metals::index_of_refraction(object.choice("material", &names, metals::NONE)?);
        let (eta, k) = (object.index("eta", eta)?, object.index("k", k)?);
        // Indices are relative to what surrounds the metal.
        let outside = ior(object, "ext_eta", 1.0)?;
        let (eta, k) = (eta / outside, k / outside);
        Ok(Self { eta, k, reflectance: loader.texture(object, "specular_reflectance", Rgb::ONE)? })
    }

    /// Colour at normal incidence.
    pub fn albedo(&self, surface: &Surface) -> Rgb {
        let reflectance = fresnel::conductor(1.0, self.eta, self.k) * self.reflectance.color(&surface.at);
        reflectance.clamp(Rgb::ZERO, Rgb::ONE)
    }

    /// Complex index of refraction and factor at a surface point.
    pub fn at(&self, at: &Point) -> [Lanes3<1>; 3] {
        [self.eta, self.k, self.reflectance.color(at)].map(Lanes3::splat)
    }

    /// The factor.
    pub fn texture(&self) -> &dyn Texture {
        &*self.reflectance
    }
}

struct Conductor {
    metal: Metal,
}

impl Bsdf for Conductor {
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let [eta, k, tint] = self.metal.at(at);
        Some(closure::Conductor { eta, k, tint }.closure(None))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        vec![self.metal.texture()]
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.metal.albedo(surface)
    }
}
