//! What packets have to know of shapes and emitters without asking them: decided once for a scene.

use std::sync::Arc;

use crate::math::Rgb;
use crate::scene::Shape;
use crate::scene::emitter::Emitter;
use crate::scene::shape::Geometry;
use crate::scene::texture::Texture;

/// Of a shape.
pub struct Finish {
    /// Number of its emitter, if it glows.
    pub emitter: Option<u32>,
    /// Whether the material is diffuse and nothing else.
    pub lambert: bool,
    /// Whether it looks the same from behind.
    pub two_sided: bool,
    /// Reflectance of a diffuse material, where `texture` does not say.
    pub color: Rgb,
    /// Reflectance of a diffuse material.
    pub texture: Option<Arc<dyn Texture>>,
    /// Whether its surfaces can be worked out together with others: meshes whose material needs no derivatives.
    pub mesh: bool,
    /// Whether anybody looks at texture coordinates.
    pub uv: bool,
}

impl Finish {
    /// What a shape is like.
    pub fn new(shape: &Shape) -> Self {
        let mesh = matches!(&*shape.geometry, Geometry::Mesh(_)) && !shape.bsdf.needs_derivatives();
        let emitter = shape.emitter;
        let Some(lambert) = shape.bsdf.lambert() else {
            return Self { emitter, lambert: false, two_sided: false, color: Rgb::ZERO, texture: None, mesh, uv: true };
        };
        let color = lambert.reflectance.constant();
        Self {
            emitter,
            lambert: true,
            two_sided: lambert.two_sided,
            color: color.unwrap_or_default(),
            texture: color.is_none().then_some(lambert.reflectance),
            mesh,
            uv: color.is_none() || emitter.is_some(),
        }
    }
}

/// Of an emitter.
pub struct Lamp {
    /// The mesh, if it is one that glows evenly.
    pub mesh: Option<Arc<Geometry>>,
    /// Its radiance.
    pub radiance: Rgb,
    /// Density per area of choosing the emitter and a point on it.
    pub density: f32,
}

impl Lamp {
    /// What an emitter is like that is chosen with a probability of `chance`.
    pub fn new(emitter: &dyn Emitter, chance: f32) -> Self {
        match emitter.even() {
            Some((geometry, radiance)) if matches!(&**geometry, Geometry::Mesh(_)) => {
                let density = chance * (1.0 / geometry.area());
                Self { mesh: Some(Arc::clone(geometry)), radiance, density }
            }
            _ => Self { mesh: None, radiance: Rgb::ZERO, density: 0.0 },
        }
    }
}
