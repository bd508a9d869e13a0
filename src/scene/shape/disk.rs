//! Disks.

use std::f32::consts::{PI, TAU};

use super::finite::finite;
use super::{Bounds, Geometry};
use crate::error::Result;
use crate::ffi::embree::{Hit, Quadric, QuadricKind};
use crate::math::{Frame, Mat4, Vec2, Vec3, vec2, vec3, warp};
use crate::scene::light_point::{LightPoint, Position};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::{Ray, Surface, texture};

/// `disk`: the unit disk in the plane z = 0, facing +z; an ellipse when scaled unevenly.
pub const PLUGIN: Plugin<Geometry> = Plugin { name: "disk", parameters: "to_world, flip_normals = false", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Geometry> {
    let to_world = loader.to_world(object)?;
    let side = if object.boolean("flip_normals", false)? { -1.0 } else { 1.0 };
    finite(object, Geometry::Disk(Disk { to_world, to_object: to_world.inverse(), side }))
}

/// One disk in world space.
pub struct Disk {
    to_world: Mat4,
    to_object: Mat4,
    /// -1 when it faces -z.
    side: f32,
}

impl Disk {
    fn normal(&self) -> Vec3 {
        self.to_object.transpose().transform_vector3(Vec3::Z).normalize_or(Vec3::Z) * self.side
    }

    /// Radius and angle, the latter in turns.
    fn texture_point(local: Vec2) -> texture::Point {
        let angle = local.y.atan2(local.x).rem_euclid(TAU) / TAU;
        texture::Point { uv: vec2(local.length(), angle), ..texture::Point::default() }
    }

    /// The surface at the point that a ray has hit.
    pub fn surface(&self, hit: &Hit, ray: Ray) -> Surface {
        let local = self.to_object.transform_point3(ray.origin + ray.direction * hit.t).truncate();
        let outward = local.normalize_or(Vec2::X);
        let tangent = |v: Vec2| self.to_world.transform_vector3(v.extend(0.0));
        let (dp_du, dp_dv) = (tangent(outward), tangent(TAU * local.perp()));
        let n = self.normal();
        let frame = Frame::along(n, dp_du);
        Surface {
            p: self.to_world.transform_point3(local.extend(0.0)),
            n,
            frame,
            at: Self::texture_point(local),
            dp_du,
            dp_dv,
            instance: u32::MAX,
            epsilon: 0.0,
            curvature: 0.0,
            wi: frame.to_local(-ray.direction),
        }
    }

    /// Its area, exact for ellipses.
    pub fn area(&self) -> f32 {
        let [x, y] = [Vec3::X, Vec3::Y].map(|axis| self.to_world.transform_vector3(axis));
        PI * x.cross(y).length()
    }

    /// Box around it.
    pub fn bounds(&self) -> Bounds {
        Bounds { lower: vec3(-1.0, -1.0, 0.0), upper: vec3(1.0, 1.0, 0.0) }.transformed(self.to_world)
    }

    /// For Embree.
    pub fn quadric(&self) -> Quadric {
        super::quadric(QuadricKind::FLUXION_DISK, self.to_object, self.bounds())
    }

    /// A point uniform over the area.
    pub fn sample(&self, u: Vec2) -> LightPoint {
        let local = warp::disk(u);
        let p = self.to_world.transform_point3(local.extend(0.0));
        LightPoint::drawn(Position::Surface { p, n: self.normal() }, Self::texture_point(local))
    }
}
