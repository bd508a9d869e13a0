//! Lambert's law, on the outside only.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::{Bsdf, BsdfSample, Eval, Lambert, Lobe};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, warp};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::{Constant, Texture};

/// `diffuse`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin { name: "diffuse", parameters: "reflectance = 0.5", make };

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(Diffuse { reflectance: loader.texture(object, "reflectance", Rgb::splat(0.5))? }))
}

/// Grey of one reflectance everywhere.
pub fn uniform(reflectance: f32) -> Arc<dyn Bsdf> {
    Arc::new(Diffuse { reflectance: Arc::new(Constant(Rgb::splat(reflectance))) })
}

struct Diffuse {
    reflectance: Arc<dyn Texture>,
}

impl Bsdf for Diffuse {
    fn sample(&self, surface: &Surface, wi: Vec3, _lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wo = warp::cosine_hemisphere(u);
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let weight = self.reflectance.color(&surface.at);
        Some(BsdfSample { wo, weight, pdf: warp::cosine_hemisphere_pdf(wo.z), lobe: Lobe::Smooth, eta: 1.0 })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Eval::default();
        }
        let value = self.reflectance.color(&surface.at) * (FRAC_1_PI * wo.z);
        Eval { value, pdf: warp::cosine_hemisphere_pdf(wo.z) }
    }

    fn lambert(&self) -> Option<Lambert> {
        Some(Lambert { reflectance: Arc::clone(&self.reflectance), two_sided: false })
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        Some(f32::INFINITY)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.reflectance.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }
}
