//! Shapes: triangle meshes and spheres, and the plugins that make them.

mod cube;
mod files;
pub mod mesh;
mod rectangle;
pub mod sphere;

pub use self::mesh::Mesh;
pub use self::sphere::Sphere;
use super::emitter::LightPoint;
use super::load::Plugin;
use super::{Ray, Surface};
use crate::ffi::embree::Hit;
use crate::math::{Vec2, Vec3};

/// The shapes of scene files.
pub const PLUGINS: &[Plugin<Geometry>] =
    &[files::OBJ, files::PLY, files::SERIALIZED, rectangle::PLUGIN, cube::PLUGIN, sphere::PLUGIN];

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub lower: Vec3,
    /// Largest coordinates.
    pub upper: Vec3,
}

impl Bounds {
    /// A box with nothing in it.
    pub const EMPTY: Self = Self { lower: Vec3::INFINITY, upper: Vec3::NEG_INFINITY };

    /// The box around some points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |all, p| Self { lower: all.lower.min(p), upper: all.upper.max(p) })
    }

    /// The box around two boxes.
    pub fn union(self, other: Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// Whether there is nothing in it.
    pub fn is_empty(self) -> bool {
        self.lower.cmpgt(self.upper).any()
    }

    /// Whether every coordinate is finite, as in an empty box by convention.
    pub fn is_finite(self) -> bool {
        self.is_empty() || (self.lower.is_finite() && self.upper.is_finite())
    }

    /// Centre and radius of the sphere around the box; a unit sphere for an empty one.
    pub fn sphere(self) -> (Vec3, f32) {
        if self.is_empty() {
            return (Vec3::ZERO, 1.0);
        }
        let center = 0.5 * self.lower + 0.5 * self.upper;
        (center, center.distance(self.upper).max(f32::MIN_POSITIVE))
    }
}

/// The two kinds of surface that are traced.
pub enum Geometry {
    /// Triangles.
    Mesh(Mesh),
    /// One sphere.
    Sphere(Sphere),
}

impl Geometry {
    /// What a ray has hit. `derivatives`: whether dp_du and dp_dv are wanted.
    #[inline]
    pub fn surface(&self, hit: &Hit, ray: Ray, derivatives: bool) -> Surface {
        match self {
            Self::Mesh(mesh) => mesh.surface(hit, ray, derivatives),
            Self::Sphere(sphere) => sphere.surface(hit, ray, derivatives),
        }
    }

    /// Total area.
    pub fn area(&self) -> f32 {
        match self {
            Self::Mesh(mesh) => mesh.area(),
            Self::Sphere(sphere) => sphere.area(),
        }
    }

    /// Box around it.
    pub fn bounds(&self) -> Bounds {
        match self {
            Self::Mesh(mesh) => mesh.bounds(),
            Self::Sphere(sphere) => sphere.bounds(),
        }
    }

    /// A point to light `from` with; the emitter's number is left to the caller.
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<LightPoint> {
        match self {
            Self::Mesh(mesh) => mesh.sample(u),
            Self::Sphere(sphere) => sphere.sample(from, u),
        }
    }

    /// Density of [`Geometry::sample`] per solid angle at `from`.
    pub fn pdf(&self, from: Vec3, point: &LightPoint) -> f32 {
        match self {
            Self::Mesh(mesh) => mesh.pdf(from, point),
            Self::Sphere(sphere) => sphere.pdf(from, point),
        }
    }
}
