//! Shading normals read from a texture.

use std::sync::Arc;

use super::Bsdf;
use super::perturbed::{NormalMap, Perturbed};
use crate::error::Result;
use crate::math::{Rgb, Vec3, vec3};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::Texture;

/// `normalmap`: red, green and blue in [0, 1] are the normal's x, y and z in [-1, 1]. Image files want `raw`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "normalmap",
    parameters: "normalmap or one nested texture, flip_invalid_normals = true, use_shadowing_function = true, one nested bsdf",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    // In older files the texture has no name.
    let normals = match object.get("normalmap") {
        Some(_) => loader.texture(object, "normalmap", vec3(0.5, 0.5, 1.0))?,
        None => loader.nested_texture(object)?,
    };
    let normals = Normals(normals);
    Ok(Arc::new(Perturbed::load(object, loader, normals)?))
}

struct Normals(Arc<dyn Texture>);

impl NormalMap for Normals {
    fn normal(&self, surface: &Surface) -> Vec3 {
        (2.0 * self.0.color(&surface.at) - Rgb::ONE).normalize_or(Vec3::Z)
    }

    fn texture(&self) -> &dyn Texture {
        &*self.0
    }
}
