//! Spheres.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use super::finite::finite;
use super::mesh::{Mesh, Placement};
use super::{Bounds, Geometry, tessellation};
use crate::error::Result;
use crate::ffi::embree::Hit;
use crate::math::{Frame, Mat4, Vec2, Vec3, vec2, vec3, warp};
use crate::scene::light_point::{LightPoint, Position};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::{Ray, Surface, texture};

/// `sphere`: centre and radius, then `to_world`.
pub const PLUGIN: Plugin<Geometry> =
    Plugin { name: "sphere", parameters: "center = 0, radius = 1, to_world, flip_normals = false", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Geometry> {
    let center = object.vector("center", Vec3::ZERO)?;
    let radius = object.float("radius", 1.0)?;
    let to_world = loader.to_world(object)?;
    let flip = object.boolean("flip_normals", false)?;
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| to_world.transform_vector3(axis).length());
    if radius <= 0.0 || !radius.is_finite() {
        return Err(object.loc_of("radius").invalid("`radius` must be positive"));
    }
    let skewed = axes.iter().any(|axis| (axis - axes[0]).abs() > 1e-3 * axes[0]) || tessellation::is_sheared(to_world);
    if skewed {
        loader.warn(&object.loc_of("to_world"), "a sphere scaled unevenly is traced as a mesh of triangles")?;
        let placed = to_world * Mat4::from_translation(center) * Mat4::from_scale(Vec3::splat(radius));
        let placement = Placement { to_world: placed, face_normals: false, flip_normals: flip };
        return finite(object, Geometry::Mesh(Mesh::new(tessellation::sphere(), placement)));
    }
    let mirrored = to_world.determinant() < 0.0;
    finite(
        object,
        Geometry::Sphere(Sphere {
            center: to_world.transform_point3(center),
            radius: radius * axes[0],
            to_object: to_world.inverse(),
            side: if flip != mirrored { -1.0 } else { 1.0 },
        }),
    )
}

/// One sphere in world space.
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
    /// Directions to the axes that texture coordinates are measured on.
    to_object: Mat4,
    /// -1 when the inside is the outside.
    side: f32,
}

impl Sphere {
    /// Texture coordinates, if they are wanted: their angles cost as much as the rest of the surface.
    #[inline]
    fn at(&self, outward: Vec3, uv: bool) -> texture::Point {
        let uv = if uv { self.uv(outward) } else { Vec2::ZERO };
        texture::Point { uv, ..texture::Point::default() }
    }

    fn uv(&self, outward: Vec3) -> Vec2 {
        let local = self.to_object.transform_vector3(outward).normalize_or(Vec3::Z);
        let phi = local.y.atan2(local.x);
        vec2(phi.rem_euclid(TAU) / TAU, local.z.clamp(-1.0, 1.0).acos() * FRAC_1_PI)
    }

    /// The surface at the point that a ray has hit.
    pub fn surface(&self, hit: &Hit, ray: Ray, (derivatives, uv): (bool, bool)) -> Surface {
        // The hit pulled onto the sphere: its distance is less exact than its direction from the centre.
        let outward = (ray.origin + ray.direction * hit.t - self.center).normalize_or(-ray.direction);
        let n = outward * self.side;
        let (dp_du, dp_dv) = if derivatives { self.derivatives(outward) } else { (Vec3::ZERO, Vec3::ZERO) };
        let frame = if derivatives { Frame::along(n, dp_du) } else { Frame::around(n) };
        Surface {
            p: self.center + outward * self.radius,
            n,
            frame,
            at: self.at(outward, uv),
            dp_du,
            dp_dv,
            instance: u32::MAX,
            epsilon: 0.0,
            curvature: self.radius * self.side,
            wi: frame.to_local(-ray.direction),
        }
    }

    fn derivatives(&self, outward: Vec3) -> (Vec3, Vec3) {
        let local = self.to_object.transform_vector3(outward).normalize_or(Vec3::Z);
        let ring = vec2(local.x, local.y).length();
        let (cos, sin) = if ring > 0.0 { (local.x / ring, local.y / ring) } else { (1.0, 0.0) };
        let du = TAU * vec3(-local.y, local.x, 0.0);
        let dv = PI * vec3(local.z * cos, local.z * sin, -ring);
        let to_world = self.to_object.inverse();
        let scale = self.radius / to_world.transform_vector3(Vec3::X).length();
        (to_world.transform_vector3(du) * scale, to_world.transform_vector3(dv) * scale)
    }

    /// Surface area.
    pub fn area(&self) -> f32 {
        4.0 * PI * self.radius * self.radius
    }

    /// Box around it.
    pub fn bounds(&self) -> Bounds {
        Bounds { lower: self.center - self.radius, upper: self.center + self.radius }
    }

    /// 1 - cos of the half angle under which the sphere is seen, if `from` is outside it.
    fn versine(&self, from: Vec3) -> Option<f32> {
        let distance_squared = from.distance_squared(self.center);
        let sin2 = self.radius * self.radius / distance_squared;
        // 1 - sqrt(1 - x), without the cancellation for small x.
        (sin2 < 0.9999).then(|| sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }

    fn point(&self, outward: Vec3, uv: bool) -> LightPoint {
        let position = Position::Surface { p: self.center + outward * self.radius, n: outward * self.side };
        LightPoint::drawn(position, self.at(outward, uv))
    }

    /// A point uniform over the cone that `from` sees, or over the area from inside; with its texture coordinates if they are wanted.
    pub fn sample(&self, from: Vec3, u: Vec2, uv: bool) -> Option<LightPoint> {
        let Some(versine) = self.versine(from) else {
            return Some(self.point(warp::sphere(u), uv));
        };
        let axis = self.center - from;
        let distance = axis.length();
        let local = warp::cone(u, versine);
        // The nearer of the two intersections of the direction with the sphere.
        let half_chord2 = self.radius * self.radius - distance * distance * (1.0 - local.z * local.z);
        let along = distance * local.z - half_chord2.max(0.0).sqrt();
        let p = from + Frame::around(axis / distance).to_world(local) * along;
        Some(self.point((p - self.center).try_normalize()?, uv))
    }

    /// Density of [`Sphere::sample`] per solid angle at `from`.
    pub fn pdf(&self, from: Vec3, point: &LightPoint) -> f32 {
        let Some(versine) = self.versine(from) else {
            return point.area_to_solid_angle(from, 1.0 / self.area());
        };
        let Position::Surface { p, .. } = point.position else { return 0.0 };
        // From outside only the near side is ever drawn.
        if (p - self.center).dot(from - p) > 0.0 { 1.0 / (TAU * versine) } else { 0.0 }
    }
}
