//! Shapes: triangle meshes and spheres, and the plugins that make them.

mod cube;
pub mod curves;
pub mod cylinder;
pub mod disk;
mod files;
mod finite;
pub mod mesh;
mod plugins;
mod rectangle;
mod smooth;
pub mod sphere;
mod tessellation;

use std::f32::consts::PI;

pub use self::curves::Curves;
pub use self::cylinder::Cylinder;
pub use self::disk::Disk;
pub use self::mesh::Mesh;
pub use self::plugins::PLUGINS;
pub use self::sphere::Sphere;
use super::light_point::LightPoint;
use super::{Ray, Surface};
use crate::ffi::embree::{Hit, Quadric, QuadricKind};
use crate::math::{Mat4, Vec2, Vec3};

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

    /// Area that the sphere around the box shows to light from afar.
    pub fn cross_section(self) -> f32 {
        let (_, radius) = self.sphere();
        PI * radius * radius
    }

    /// The box around this one after a transform.
    pub fn transformed(self, matrix: Mat4) -> Self {
        if self.is_empty() {
            return self;
        }
        let corner = |i: u32| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.lower[axis] } else { self.upper[axis] };
            matrix.transform_point3(Vec3::new(pick(0), pick(1), pick(2)))
        };
        Self::of((0..8).map(corner))
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

/// The kinds of surface that are traced.
pub enum Geometry {
    /// Triangles.
    Mesh(Mesh),
    /// One sphere.
    Sphere(Sphere),
    /// One disk.
    Disk(Disk),
    /// One cylinder without caps.
    Cylinder(Cylinder),
    /// Round curves.
    Curves(Curves),
}

impl Geometry {
    /// The surface at the point that a ray has hit. `derivatives`: whether dp_du and dp_dv are wanted; `uv`: whether texture
    /// coordinates are, where they cost much.
    #[inline]
    pub fn surface(&self, hit: &Hit, ray: Ray, (derivatives, uv): (bool, bool)) -> Surface {
        match self {
            Self::Mesh(mesh) => mesh.surface(hit, ray, derivatives),
            Self::Sphere(sphere) => sphere.surface(hit, ray, (derivatives, uv)),
            Self::Disk(disk) => disk.surface(hit, ray),
            Self::Cylinder(cylinder) => cylinder.surface(hit, ray),
            Self::Curves(curves) => curves.surface(hit, ray, derivatives),
        }
    }

    /// Total area.
    pub fn area(&self) -> f32 {
        match self {
            Self::Mesh(mesh) => mesh.area(),
            Self::Sphere(sphere) => sphere.area(),
            Self::Disk(disk) => disk.area(),
            Self::Cylinder(cylinder) => cylinder.area(),
            Self::Curves(curves) => curves.area(),
        }
    }

    /// Box around it.
    pub fn bounds(&self) -> Bounds {
        match self {
            Self::Mesh(mesh) => mesh.bounds(),
            Self::Sphere(sphere) => sphere.bounds(),
            Self::Disk(disk) => disk.bounds(),
            Self::Cylinder(cylinder) => cylinder.bounds(),
            Self::Curves(curves) => curves.bounds(),
        }
    }

    /// The middle of all geometric normals and the largest angle to one of them; π where they are not known.
    pub fn normals(&self) -> (Vec3, f32) {
        match self {
            Self::Mesh(mesh) => mesh.normals(),
            Self::Sphere(_) | Self::Disk(_) | Self::Cylinder(_) | Self::Curves(_) => (Vec3::Z, PI),
        }
    }

    /// A point to light `from` with, but for curves, which do not emit; the emitter's number is left to the caller.
    pub fn sample(&self, from: Vec3, u: Vec2, uv: bool) -> Option<LightPoint> {
        match self {
            Self::Mesh(mesh) => mesh.sample(u),
            Self::Sphere(sphere) => sphere.sample(from, u, uv),
            Self::Disk(disk) => Some(disk.sample(u)),
            Self::Cylinder(cylinder) => Some(cylinder.sample(u)),
            Self::Curves(_) => None,
        }
    }

    /// Density of [`Geometry::sample`] per solid angle at `from`.
    pub fn pdf(&self, from: Vec3, point: &LightPoint) -> f32 {
        match self {
            Self::Mesh(mesh) => mesh.pdf(from, point),
            Self::Sphere(sphere) => sphere.pdf(from, point),
            Self::Disk(disk) => point.area_to_solid_angle(from, 1.0 / disk.area()),
            Self::Cylinder(cylinder) => point.area_to_solid_angle(from, 1.0 / cylinder.area()),
            Self::Curves(_) => 0.0,
        }
    }
}

/// A quadric as Embree's side wants it.
fn quadric(kind: QuadricKind, to_object: Mat4, bounds: Bounds) -> Quadric {
    let columns = to_object.to_cols_array_2d();
    let mut flat = [0.0; 12];
    for (to, column) in flat.chunks_exact_mut(3).zip(columns) {
        to.copy_from_slice(&column[..3]);
    }
    // A flat box would let rays along it slip past.
    let margin = 1e-6 * (bounds.lower.abs().max(bounds.upper.abs()) + (bounds.upper - bounds.lower));
    let (lower, upper) = ((bounds.lower - margin).to_array(), (bounds.upper + margin).to_array());
    Quadric { kind, to_object: flat, lower, upper }
}
