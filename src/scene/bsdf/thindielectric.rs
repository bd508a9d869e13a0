//! A thin pane: both of its boundaries at once, with all reflections between them. Light passes unbent.

use std::sync::Arc;

use super::ior::{BK7, relative_ior};
use super::{Bsdf, BsdfSample, Delta, Eval, Lobe};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::Texture;

/// `thindielectric`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "thindielectric",
    parameters: "int_ior = bk7, ext_ior = air, specular_reflectance = 1, specular_transmittance = 1",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(ThinDielectric {
        eta: relative_ior(object, BK7)?,
        reflectance: loader.texture(object, "specular_reflectance", Rgb::ONE)?,
        transmittance: loader.texture(object, "specular_transmittance", Rgb::ONE)?,
    }))
}

struct ThinDielectric {
    eta: f32,
    reflectance: Arc<dyn Texture>,
    transmittance: Arc<dyn Texture>,
}

impl ThinDielectric {
    /// r + t r t + t r³ t + ...
    fn pane_reflectance(&self, cos: f32) -> f32 {
        let r = fresnel::dielectric(cos.abs(), self.eta).reflectance;
        if r < 1.0 { 2.0 * r / (1.0 + r) } else { 1.0 }
    }
}

impl Bsdf for ThinDielectric {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let lobe = if lobe < self.pane_reflectance(wi.z) { Lobe::DeltaReflect } else { Lobe::Null };
        let Delta { wo, value, probability } = self.delta(surface, wi, lobe)?;
        Some(BsdfSample { wo, weight: value / probability, pdf: probability, lobe, eta: 1.0 })
    }

    fn eval(&self, _surface: &Surface, _wi: Vec3, _wo: Vec3) -> Eval {
        Eval::default()
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let reflectance = self.pane_reflectance(wi.z);
        let (wo, tint, probability) = match lobe {
            Lobe::DeltaReflect => (fresnel::reflect(wi), &self.reflectance, reflectance),
            Lobe::Null => (-wi, &self.transmittance, 1.0 - reflectance),
            _ => return None,
        };
        (probability > 0.0).then(|| Delta { wo, value: tint.color(&surface.at) * probability, probability })
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
