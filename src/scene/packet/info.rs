//! Properties of shapes and emitters that packets evaluate without virtual calls; found once, when a scene is built.

use std::sync::Arc;

use crate::math::alias::Alias;
use crate::math::{Rgb, Vec3};
use crate::scene::Shape;
use crate::scene::emitter::Emitter;
use crate::scene::shape::mesh::Corners;
use crate::scene::shape::{Geometry, Mesh};
use crate::scene::texture::Texture;

/// Properties of a shape.
pub struct ShapeInfo {
    /// Index of its emitter, if it is emissive.
    pub emitter: Option<u32>,
    /// Whether the material is a diffuse lobe and nothing else.
    pub lambert: bool,
    /// Whether the diffuse lobe is on both sides.
    pub two_sided: bool,
    /// Reflectance of a diffuse material without a texture.
    pub color: Rgb,
    /// Reflectance of a diffuse material with a texture.
    pub texture: Option<Arc<dyn Texture>>,
    /// Whether its hits are completed in lanes: meshes whose material needs no derivatives.
    pub mesh: bool,
    /// Whether texture coordinates are used.
    pub uv: bool,
}

impl ShapeInfo {
    /// The properties of a shape.
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

/// Properties of an emitter.
pub struct EmitterInfo {
    /// The triangles, if it is a mesh of uniform radiance.
    pub mesh_light: Option<UniformMeshLight>,
    /// Density per area of choosing the emitter and a point on it; 0 if the choice depends on the receiving point.
    pub density: f32,
}

/// A mesh that emits the same radiance everywhere.
pub struct UniformMeshLight {
    /// Its radiance.
    pub radiance: Rgb,
    /// Its area.
    pub area: f32,
    /// Alias table over the triangles by area.
    pub areas: Alias,
    /// The triangles.
    pub triangles: Vec<LightTriangle>,
}

/// An emissive triangle.
#[derive(Clone, Copy)]
pub struct LightTriangle {
    /// A corner.
    pub corner: Vec3,
    /// Edges from that corner to the other two.
    pub sides: [Vec3; 2],
    /// Unit normal on the emissive side.
    pub n: Vec3,
}

impl EmitterInfo {
    /// The properties of an emitter; `chance` is the probability of choosing it, if that is the same for all receivers.
    pub fn new(emitter: &dyn Emitter, chance: Option<f32>) -> Self {
        let mesh_light = emitter.uniform_mesh().and_then(|(geometry, radiance)| match &**geometry {
            Geometry::Mesh(mesh) => UniformMeshLight::new(mesh, radiance),
            _ => None,
        });
        let density = mesh_light.as_ref().map_or(0.0, |mesh_light| chance.unwrap_or_default() / mesh_light.area);
        Self { mesh_light, density }
    }
}

impl UniformMeshLight {
    /// `None` for an empty mesh, and if the shading normals of a triangle disagree about its emissive side.
    fn new(mesh: &Mesh, radiance: Rgb) -> Option<Self> {
        let light_triangle = |index| {
            let Corners { p: [a, b, c], n } = *mesh.corners(index);
            let flat = (b - a).cross(c - a).normalize_or(Vec3::Z) * mesh.side();
            let sides = n.map(|n| flat.dot(n * mesh.side()));
            let agree = sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side < 0.0);
            agree.then(|| LightTriangle { corner: a, sides: [b - a, c - a], n: flat * 1f32.copysign(sides[0]) })
        };
        let triangles = (0..mesh.triangles.len() as u32).map(light_triangle).collect::<Option<_>>()?;
        Some(Self { radiance, area: mesh.area(), areas: mesh.areas()?.clone(), triangles })
    }
}
