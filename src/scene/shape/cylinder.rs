//! Cylinders without caps.

use std::f32::consts::TAU;

use super::finite::finite;
use super::mesh::{Mesh, Placement};
use super::{Bounds, Geometry, tessellation};
use crate::error::Result;
use crate::ffi::embree::{Hit, Quadric, QuadricKind};
use crate::math::{Frame, Mat4, Vec2, Vec3, vec2, vec3};
use crate::scene::light_point::{LightPoint, Position};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::{Ray, Surface, texture};

/// `cylinder`: from `p0` to `p1`, then `to_world`.
pub const PLUGIN: Plugin<Geometry> =
    Plugin { name: "cylinder", parameters: "p0 = 0, p1 = +z, radius = 1, to_world, flip_normals = false", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Geometry> {
    let (p0, p1) = (object.vector("p0", Vec3::ZERO)?, object.vector("p1", Vec3::Z)?);
    let radius = object.float("radius", 1.0)?;
    let side = if object.boolean("flip_normals", false)? { -1.0 } else { 1.0 };
    let axis = p1 - p0;
    if radius <= 0.0 || axis == Vec3::ZERO {
        return Err(object.loc.invalid("a cylinder needs a positive `radius` and two different ends"));
    }
    let Frame { s, t, .. } = Frame::around(axis.normalize());
    let placed = Mat4::from_cols((s * radius).extend(0.0), (t * radius).extend(0.0), axis.extend(0.0), p0.extend(1.0));
    let to_world = loader.to_world(object)? * placed;
    let [x, y] = [Vec3::X, Vec3::Y].map(|axis| to_world.transform_vector3(axis).length());
    if (x - y).abs() > 1e-3 * x || tessellation::is_sheared(to_world) {
        loader.warn(&object.loc_of("to_world"), "a cylinder scaled unevenly is traced as a mesh of triangles")?;
        let placement = Placement { to_world, face_normals: false, flip_normals: side < 0.0 };
        return finite(object, Geometry::Mesh(Mesh::new(tessellation::cylinder(), placement)));
    }
    finite(object, Geometry::Cylinder(Cylinder { to_world, to_object: to_world.inverse(), radius: x, side }))
}

/// One cylinder in world space.
pub struct Cylinder {
    /// From the unit cylinder about z in [0, 1].
    to_world: Mat4,
    to_object: Mat4,
    radius: f32,
    /// -1 when the inside is the outside.
    side: f32,
}

impl Cylinder {
    fn normal(&self, across: Vec2) -> Vec3 {
        let n = self.to_object.transpose().transform_vector3(across.extend(0.0));
        n.normalize_or(Vec3::Z) * self.side
    }

    /// Angle in turns, and height.
    fn texture_point(across: Vec2, height: f32) -> texture::Point {
        let angle = across.y.atan2(across.x).rem_euclid(TAU) / TAU;
        texture::Point { uv: vec2(angle, height), ..texture::Point::default() }
    }

    /// The surface at the point that a ray has hit.
    pub fn surface(&self, hit: &Hit, ray: Ray) -> Surface {
        let local = self.to_object.transform_point3(ray.origin + ray.direction * hit.t);
        // The hit pulled onto the cylinder, as its distance is not exact.
        let across = local.truncate().normalize_or(Vec2::X);
        let tangent = |v: Vec3| self.to_world.transform_vector3(v);
        let (dp_du, dp_dv) = (tangent((TAU * across.perp()).extend(0.0)), tangent(Vec3::Z));
        let n = self.normal(across);
        let frame = Frame::along(n, dp_du);
        Surface {
            p: self.to_world.transform_point3(across.extend(local.z)),
            n,
            frame,
            at: Self::texture_point(across, local.z),
            dp_du,
            dp_dv,
            instance: u32::MAX,
            epsilon: 0.0,
            curvature: self.radius * self.side,
            wi: frame.to_local(-ray.direction),
        }
    }

    /// Its area.
    pub fn area(&self) -> f32 {
        let length = |axis| self.to_world.transform_vector3(axis).length();
        TAU * length(Vec3::X) * length(Vec3::Z)
    }

    /// Box around it.
    pub fn bounds(&self) -> Bounds {
        Bounds { lower: vec3(-1.0, -1.0, 0.0), upper: Vec3::ONE }.transformed(self.to_world)
    }

    /// For Embree.
    pub fn quadric(&self) -> Quadric {
        super::quadric(QuadricKind::FLUXION_CYLINDER, self.to_object, self.bounds())
    }

    /// A point uniform over the area.
    pub fn sample(&self, u: Vec2) -> LightPoint {
        let across = Vec2::from_angle(TAU * u.x);
        let p = self.to_world.transform_point3(across.extend(u.y));
        LightPoint::drawn(Position::Surface { p, n: self.normal(across) }, Self::texture_point(across, u.y))
    }
}
