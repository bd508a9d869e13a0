//! Lambert's law, on the outside only.

use std::sync::Arc;

use super::{Bsdf, Whole};
use crate::error::Result;
use crate::math::Rgb;
use crate::math::lanes::Lanes3;
use crate::scene::Surface;
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Constant, Point, Texture};

/// `diffuse`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin { name: "diffuse", parameters: "reflectance = 0.5", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
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
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let reflectance = Lanes3::splat(self.reflectance.color(at));
        Some(closure::Diffuse { reflectance }.closure(Some(f32::INFINITY)))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        vec![&*self.reflectance]
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.reflectance.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }
}
