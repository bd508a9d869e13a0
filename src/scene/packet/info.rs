//! Properties of shapes and emitters that packets evaluate without virtual calls; found once, when a scene is built.

use crate::math::alias::Alias;
use crate::math::{Rgb, Vec3};
use crate::scene::closure::{Closure, Kind};
use crate::scene::emitter::{Emitter, LightTriangle};
use crate::scene::shape::mesh::Corners;
use crate::scene::shape::{Geometry, Mesh};
use crate::scene::{Shape, Surface};

/// Properties of a shape.
pub struct ShapeInfo {
    /// Index of its emitter, if it is emissive.
    pub emitter: Option<u32>,
    /// Whether the material has a closure.
    pub closes: bool,
    /// Number of the kind of closure.
    pub kind: usize,
    /// Whether that is a diffuse lobe and nothing else.
    pub diffuse: bool,
    /// Whether it scatters nothing to the side that light does not come from, as its shading normal tells.
    pub one_sided: bool,
    /// The closure, if it is the same everywhere.
    pub closure: Option<Closure>,
    /// Whether its hits are completed in lanes: meshes whose material needs no derivatives.
    pub mesh: bool,
    /// Whether texture coordinates are used.
    pub uv: bool,
    /// Whether the material looks images up.
    pub images: bool,
}

impl ShapeInfo {
    /// The same without faster ways: the material is evaluated through its trait, and texture coordinates are always looked up. Renders
    /// have the same bits, and take longer.
    pub fn general(self) -> Self {
        Self { closes: false, closure: None, uv: true, ..self }
    }

    /// The properties of a shape.
    pub fn new(shape: &Shape) -> Self {
        let Shape { geometry, bsdf, emitter, .. } = shape;
        let mesh = matches!(&**geometry, Geometry::Mesh(_)) && !bsdf.needs_derivatives();
        let surface = Surface::default();
        let closure = bsdf.closure(&surface.at, &|| surface);
        let textures = bsdf.textures();
        let constant = textures.iter().all(|texture| texture.constant().is_some());
        let images = textures.iter().any(|texture| texture.resolution().is_some());
        let closes = closure.is_some();
        let kind = closure.map_or(Kind::None as usize, |closure| closure.kind());
        let diffuse = closure.is_some_and(|closure| closure.plainly_diffuse().any()) && !bsdf.transmits();
        // Materials that turn the frame may see light beyond its horizon.
        let one_sided = !bsdf.transmits() && !bsdf.needs_derivatives();
        let closure = closure.filter(|_| constant);
        let uv = closure.is_none() || emitter.is_some();
        Self { emitter: *emitter, closes, kind, diffuse, one_sided, mesh, uv, images, closure }
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

impl EmitterInfo {
    /// The properties of an emitter, of which the chance is not yet known.
    pub fn new(emitter: &dyn Emitter) -> Self {
        let mesh_light = emitter.uniform_mesh().and_then(|(geometry, radiance)| match &**geometry {
            Geometry::Mesh(mesh) => UniformMeshLight::new(mesh, radiance),
            _ => None,
        });
        Self { mesh_light, density: 0.0 }
    }

    /// Sets the probability of choosing it, if that is the same for all receivers.
    pub fn set_chance(&mut self, chance: Option<f32>) {
        self.density = self.mesh_light.as_ref().map_or(0.0, |mesh_light| chance.unwrap_or_default() / mesh_light.area);
    }

    /// Its triangles and their choice by area, if it is a mesh of uniform radiance.
    pub fn triangles(&self) -> Option<(&[LightTriangle], &Alias)> {
        self.mesh_light.as_ref().map(|mesh_light| (&*mesh_light.triangles, &mesh_light.areas))
    }
}

impl UniformMeshLight {
    /// `None` for an empty mesh, and if the shading normals of a triangle disagree about its emissive side.
    fn new(mesh: &Mesh, radiance: Rgb) -> Option<Self> {
        let light_triangle = |index| {
            let Corners { p: [a, b, c], n } = *mesh.corners(index);
            let flat = (b - a).cross(c - a).normalize_or(Vec3::Z) * mesh.side();
            let sides = n.map(|n| flat.dot(n * mesh.side()));
            // Without normals of its own the sides are zero, of any sign.
            let (front, back) = (sides.iter().all(|&side| side >= 0.0), sides.iter().all(|&side| side < 0.0));
            (front || back).then(|| LightTriangle {
                corner: a,
                sides: [b - a, c - a],
                n: if back { -flat } else { flat },
            })
        };
        let triangles = (0..mesh.triangles.len() as u32).map(light_triangle).collect::<Option<_>>()?;
        Some(Self { radiance, area: mesh.area(), areas: mesh.areas()?.clone(), triangles })
    }
}
