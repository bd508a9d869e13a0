//! What packets have to know of shapes and emitters without asking them: decided once for a scene.

use std::sync::Arc;

use crate::math::alias::Alias;
use crate::math::{Rgb, Vec3};
use crate::scene::Shape;
use crate::scene::emitter::Emitter;
use crate::scene::shape::mesh::Corners;
use crate::scene::shape::{Geometry, Mesh};
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
    /// The triangles, if it is a mesh that glows evenly.
    pub glow: Option<Glow>,
    /// Density per area of choosing the emitter and a point on it; 0 where the choice depends on the place.
    pub density: f32,
}

/// A mesh that glows evenly.
pub struct Glow {
    /// Its radiance.
    pub radiance: Rgb,
    /// Its area.
    pub area: f32,
    /// Its triangles by area.
    pub areas: Alias,
    /// What is needed of each.
    pub triangles: Vec<Facet>,
}

/// A glowing triangle.
#[derive(Clone, Copy)]
pub struct Facet {
    /// A corner.
    pub corner: Vec3,
    /// From there to the others.
    pub sides: [Vec3; 2],
    /// Unit normal on the side that glows.
    pub n: Vec3,
}

impl Lamp {
    /// What an emitter is like that is chosen with a probability of `chance`, if it is the same everywhere.
    pub fn new(emitter: &dyn Emitter, chance: Option<f32>) -> Self {
        let glow = emitter.even().and_then(|(geometry, radiance)| match &**geometry {
            Geometry::Mesh(mesh) => Glow::new(mesh, radiance),
            _ => None,
        });
        let density = glow.as_ref().map_or(0.0, |glow| chance.unwrap_or_default() / glow.area);
        Self { glow, density }
    }
}

impl Glow {
    /// `None` when nothing glows, or a triangle's shading normals disagree about which side does.
    fn new(mesh: &Mesh, radiance: Rgb) -> Option<Self> {
        let facet = |index| {
            let Corners { p: [a, b, c], n } = *mesh.corners(index);
            let flat = (b - a).cross(c - a).normalize_or(Vec3::Z) * mesh.side();
            let sides = n.map(|n| flat.dot(n * mesh.side()));
            let agree = sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side < 0.0);
            agree.then(|| Facet { corner: a, sides: [b - a, c - a], n: flat * 1f32.copysign(sides[0]) })
        };
        let triangles = (0..mesh.triangles.len() as u32).map(facet).collect::<Option<_>>()?;
        Some(Self { radiance, area: mesh.area(), areas: mesh.areas()?.clone(), triangles })
    }
}
