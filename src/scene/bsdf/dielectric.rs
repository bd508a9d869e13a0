//! A smooth boundary between two transparent media.

use std::sync::Arc;

use super::{BK7, Bsdf, BsdfSample, Delta, Eval, Lobe, relative_ior};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::Texture;

/// `dielectric`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "dielectric",
    parameters: "int_ior = bk7, ext_ior = air, specular_reflectance = 1, specular_transmittance = 1",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
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
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let reflectance = fresnel::dielectric(wi.z, self.eta).reflectance;
        let lobe = if lobe < reflectance { Lobe::DeltaReflect } else { Lobe::DeltaTransmit };
        let Delta { wo, value, probability } = self.delta(surface, wi, lobe)?;
        let eta = match lobe {
            Lobe::DeltaTransmit if wi.z > 0.0 => self.eta,
            Lobe::DeltaTransmit => 1.0 / self.eta,
            _ => 1.0,
        };
        Some(BsdfSample { wo, weight: value / probability, pdf: probability, lobe, eta })
    }

    fn eval(&self, _surface: &Surface, _wi: Vec3, _wo: Vec3) -> Eval {
        Eval::default()
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        if wi.z == 0.0 {
            return None;
        }
        let found = fresnel::dielectric(wi.z, self.eta);
        let (wo, tint, probability, scale) = match lobe {
            Lobe::DeltaReflect => (fresnel::reflect(wi), &self.reflectance, found.reflectance, 1.0),
            // Radiance is squeezed into the cone that it is refracted into.
            Lobe::DeltaTransmit => {
                let wo = fresnel::refract(wi, found.cos_t, found.eta_ti);
                (wo, &self.transmittance, 1.0 - found.reflectance, found.eta_ti * found.eta_ti)
            }
            _ => return None,
        };
        let value = tint.color(&surface.at) * (probability * scale);
        (probability > 0.0).then_some(Delta { wo, value, probability })
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        None
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.transmittance.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        true
    }
}
