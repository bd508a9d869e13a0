//! Shading normals perturbed by a height texture (Blinn 1978).

use std::sync::Arc;

use super::Bsdf;
use super::perturbed::{NormalMap, Perturbed};
use crate::error::Result;
use crate::math::Vec3;
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::Texture;

/// `bumpmap`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "bumpmap",
    parameters: "scale = 1, flip_invalid_normals = true, use_shadowing_function = true, one nested texture, \
        one nested bsdf",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    let bumps = Bumps { height: loader.nested_texture(object)?, scale: object.float("scale", 1.0)? };
    Ok(Arc::new(Perturbed::load(object, loader, bumps)?))
}

struct Bumps {
    height: Arc<dyn Texture>,
    scale: f32,
}

impl NormalMap for Bumps {
    fn normal(&self, surface: &Surface) -> Vec3 {
        let slope = self.height.gradient(&surface.at) * self.scale;
        let n = surface.frame.n;
        let du = surface.dp_du + n * (slope.x - n.dot(surface.dp_du));
        let dv = surface.dp_dv + n * (slope.y - n.dot(surface.dp_dv));
        let perturbed = du.cross(dv).normalize_or(n);
        surface.frame.to_local(perturbed * 1f32.copysign(surface.n.dot(perturbed)))
    }

    fn texture(&self) -> &dyn Texture {
        &*self.height
    }
}
