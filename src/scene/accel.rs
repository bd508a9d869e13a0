//! The scene's surfaces in Embree.

use std::sync::Arc;

use super::packet::{Rays, ShapeInfo};
use super::ray_log::{Purpose, RayLog, Tally};
use super::shape::{Bounds, Geometry};
use super::{Group, Ray, Shape, Surface};
use crate::error::Result;
use crate::ffi::embree::{self, Committed, Device, Hit, Hits, SceneBuilder};
use crate::math::lanes::Mask;
use crate::math::{Frame, Mat4, Vec3};

/// A committed Embree scene. Its geometry numbers are those of the shapes that stand by themselves, then those of the
/// placed groups.
pub struct Accel {
    scene: Committed,
    placements: Vec<Placement>,
    /// Number of the first placement.
    first_placement: u32,
    bounds: Bounds,
    size: f32,
    version: (u32, u32, u32),
    log: Option<RayLog>,
}

/// All shapes of a scene with their properties.
type Shapes<'a> = (&'a [Shape], &'a [ShapeInfo]);

/// A group of shapes somewhere in the world.
struct Placement {
    to_world: Mat4,
    to_group: Mat4,
    /// Factor of lengths; zero if it is not the same along all axes.
    scale: f32,
    /// Number of the group's first shape.
    first_shape: u32,
}

/// Shadow rays end just before their target, in units of their length.
pub const SHADOW_END: f32 = 1.0 - 1e-5;

impl Accel {
    /// Builds the hierarchy on `threads` threads (0: all). The shapes of the groups are numbered on after `shapes`.
    pub fn build(shapes: &[Shape], groups: &[Group], threads: usize) -> Result<Self> {
        let device = Device::new(threads)?;
        let mut builder = device.scene();
        let mut bounds = attach(&mut builder, shapes)?;
        let mut placements = Vec::new();
        let mut first_shape = shapes.len() as u32;
        for group in groups {
            let mut child = device.scene();
            let extent = attach(&mut child, &group.shapes)?;
            let child = Arc::new(child.commit()?);
            for &to_world in &group.placements {
                builder.add_instance(&child, to_world.to_cols_array())?;
                bounds = bounds.union(extent.transformed(to_world));
                placements.push(Placement::new(to_world, first_shape));
            }
            first_shape += group.shapes.len() as u32;
        }
        let (_, radius) = bounds.sphere();
        let (first_placement, size) = (shapes.len() as u32, 2.0 * radius);
        Ok(Self {
            scene: builder.commit()?,
            placements,
            first_placement,
            bounds,
            size,
            version: device.version(),
            log: None,
        })
    }

    /// The first hit along a ray.
    #[inline]
    pub fn intersect(&self, ray: Ray) -> Option<Hit> {
        let Ray { origin, direction, t_far } = ray;
        let ray = embree::Ray { origin: origin.to_array(), t_near: 0.0, direction: direction.to_array(), t_far };
        if let Some(log) = &self.log {
            log.first(ray);
        }
        self.scene.intersect(&ray)
    }

    /// The first hits along the active rays.
    #[inline]
    pub fn intersect_packet(&self, rays: &Rays, active: Mask, purpose: Purpose) -> Hits {
        let rays = rays.to_embree(active);
        if let Some(log) = &self.log {
            log.packet(rays, purpose);
        }
        self.scene.intersect_packet(&rays, purpose.is_coherent())
    }

    /// Active lanes whose ray hits anything.
    #[inline]
    pub fn occluded_packet(&self, rays: &Rays, active: Mask, purpose: Purpose) -> Mask {
        let rays = rays.to_embree(active);
        if let Some(log) = &self.log {
            log.packet(rays, purpose);
        }
        Mask(self.scene.occluded_packet(&rays))
    }

    /// Index of a shape that was hit, among all.
    #[inline(always)]
    pub fn shape_of(&self, geometry: u32, instance: u32) -> usize {
        match instance {
            u32::MAX => geometry as usize,
            _ => (self.placements[(instance - self.first_placement) as usize].first_shape + geometry) as usize,
        }
    }

    /// The surface of a hit, of one of all shapes.
    #[inline]
    pub fn surface(&self, shapes: Shapes, hit: &Hit, ray: Ray) -> Surface {
        let Some(instance) = hit.instance() else { return shape_surface(shapes, hit.geometry, hit, ray) };
        let placement = &self.placements[(instance - self.first_placement) as usize];
        Surface { instance: instance - self.first_placement, ..placement.surface(shapes, hit, ray) }
    }

    /// Whether the open segment between two points is occluded.
    #[inline]
    pub fn blocked(&self, from: Vec3, to: Vec3) -> bool {
        let (origin, direction) = (from.to_array(), (to - from).to_array());
        let ray = embree::Ray { origin, t_near: 0.0, direction, t_far: SHADOW_END };
        if let Some(log) = &self.log {
            log.any(ray);
        }
        self.scene.occluded(&ray)
    }

    /// Keeps every ray from now on.
    pub fn log_rays(&mut self) {
        self.log = Some(RayLog::default());
    }

    /// Traces all logged rays again, or those of one purpose; returns their number and the number of hits.
    pub fn replay_rays(&self, purpose: Option<Purpose>) -> (usize, usize) {
        self.log.as_ref().map_or((0, 0), |log| log.replay(&self.scene, purpose))
    }

    /// Numbers of the logged rays.
    pub fn logged_rays(&self) -> Vec<Tally> {
        self.log.as_ref().map_or_else(Vec::new, RayLog::tallies)
    }

    /// Diameter of the sphere around everything.
    pub fn size(&self) -> f32 {
        self.size
    }

    /// The box around everything.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Embree's version.
    pub fn version(&self) -> (u32, u32, u32) {
        self.version
    }
}

/// Adds shapes to an Embree scene and returns the box around them.
fn attach(builder: &mut SceneBuilder, shapes: &[Shape]) -> Result<Bounds> {
    let mut bounds = Bounds::EMPTY;
    for shape in shapes {
        bounds = bounds.union(shape.geometry.bounds());
        match &*shape.geometry {
            Geometry::Mesh(mesh) => builder.add_triangles(&mesh.positions, &mesh.triangles)?,
            Geometry::Sphere(sphere) => builder.add_spheres(vec![sphere.center.extend(sphere.radius).to_array()])?,
            Geometry::Disk(disk) => builder.add_quadric(disk.quadric())?,
            Geometry::Cylinder(cylinder) => builder.add_quadric(cylinder.quadric())?,
            Geometry::Curves(curves) => builder.add_curves(curves.data())?,
        };
    }
    Ok(bounds)
}

#[inline]
fn shape_surface((shapes, infos): Shapes, number: u32, hit: &Hit, ray: Ray) -> Surface {
    let shape = &shapes[number as usize];
    let wanted = (shape.bsdf.needs_derivatives(), infos[number as usize].uv);
    let mut surface = shape.geometry.surface(hit, ray, wanted);
    surface.at.shape = number;
    surface
}

impl Placement {
    fn new(to_world: Mat4, first_shape: u32) -> Self {
        let [x, y, z] = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(|axis| axis.truncate().length());
        let is_even = (y - x).abs().max((z - x).abs()) < 1e-3 * x;
        Self { to_world, to_group: to_world.inverse(), scale: if is_even { x } else { 0.0 }, first_shape }
    }

    /// The hit is found in the group's own coordinates, along an unnormalised ray so that distances stay the same. Kept
    /// apart from the common case, which is inlined.
    #[inline(never)]
    fn surface(&self, shapes: Shapes, hit: &Hit, ray: Ray) -> Surface {
        let inside = Ray {
            origin: self.to_group.transform_point3(ray.origin),
            direction: self.to_group.transform_vector3(ray.direction),
            t_far: ray.t_far,
        };
        let local = shape_surface(shapes, self.first_shape + hit.geometry, hit, inside);
        let normals = self.to_group.transpose();
        let normal = |n: Vec3| normals.transform_vector3(n).normalize_or_zero();
        let tangent = self.to_world.transform_vector3(local.frame.s);
        let frame = Frame::along(normal(local.frame.n), tangent);
        Surface {
            p: self.to_world.transform_point3(local.p),
            n: normal(local.n),
            frame,
            dp_du: self.to_world.transform_vector3(local.dp_du),
            dp_dv: self.to_world.transform_vector3(local.dp_dv),
            curvature: local.curvature * self.scale,
            wi: frame.to_local(-ray.direction),
            ..local
        }
    }
}
