//! A smooth boundary between two transparent media.

use std::sync::Arc;

use super::ior::{BK7, relative_ior};
use super::{Bsdf, Whole};
use crate::error::Result;
use crate::math::Rgb;
use crate::math::lanes::{Lanes, Lanes3};
use crate::scene::Surface;
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `dielectric`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "dielectric",
    parameters: "int_ior = bk7, ext_ior = air, specular_reflectance = 1, specular_transmittance = 1",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(Dielectric {
        eta: relative_ior(object, BK7)?,
        reflectance: loader.texture(object, "specular_reflectance", Rgb::ONE)?,
        transmittance: loader.texture(object, "specular_transmittance", Rgb::ONE)?,
    }))
}

struct Dielectric {
    eta: f32,
    reflectance: Arc<dyn Texture>,
    transmittance: Arc<dyn Texture>,
}

impl Bsdf for Dielectric {
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let [reflectance, transmittance] =
            [&self.reflectance, &self.transmittance].map(|factor| Lanes3::splat(factor.color(at)));
        Some(closure::Dielectric { eta: Lanes([self.eta]), reflectance, transmittance }.closure(None))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        vec![&*self.reflectance, &*self.transmittance]
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.transmittance.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        true
    }
}
