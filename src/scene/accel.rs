//! The scene's surfaces in Embree.

use super::shape::{Bounds, Geometry};
use super::{Instance, Ray};
use crate::error::Result;
use crate::ffi::embree::{self, Committed, Device, Hit};
use crate::math::Vec3;

/// A committed Embree scene; geometry numbers are instance numbers.
pub struct Accel {
    scene: Committed,
    bounds: Bounds,
    size: f32,
    version: (u32, u32, u32),
}

/// Shadow rays end just before their target, in units of their length.
const SHADOW_END: f32 = 1.0 - 1e-5;

impl Accel {
    /// Builds the hierarchy on `threads` threads (0: all).
    pub fn build(instances: &[Instance], threads: usize) -> Result<Self> {
        let device = Device::new(threads)?;
        let mut builder = device.scene();
        let mut bounds = Bounds::EMPTY;
        for instance in instances {
            bounds = bounds.union(instance.geometry.bounds());
            match &*instance.geometry {
                Geometry::Mesh(mesh) => builder.add_triangles(&mesh.positions, &mesh.triangles)?,
                Geometry::Sphere(sphere) => {
                    builder.add_spheres(vec![sphere.center.extend(sphere.radius).to_array()])?
                }
            };
        }
        let (_, radius) = bounds.sphere();
        Ok(Self { scene: builder.commit()?, bounds, size: 2.0 * radius, version: device.version() })
    }

    /// The first hit along a ray.
    #[inline]
    pub fn intersect(&self, ray: Ray) -> Option<Hit> {
        self.scene.intersect(&embree::Ray {
            origin: ray.origin.to_array(),
            t_near: 0.0,
            direction: ray.direction.to_array(),
            t_far: f32::INFINITY,
        })
    }

    /// Whether the open segment between two points meets anything.
    #[inline]
    pub fn blocked(&self, from: Vec3, to: Vec3) -> bool {
        let (origin, direction) = (from.to_array(), (to - from).to_array());
        self.scene.occluded(&embree::Ray { origin, t_near: 0.0, direction, t_far: SHADOW_END })
    }

    /// Whether the ray from a point meets anything.
    #[inline]
    pub fn blocked_to_infinity(&self, from: Vec3, direction: Vec3) -> bool {
        let (origin, direction) = (from.to_array(), direction.to_array());
        self.scene.occluded(&embree::Ray { origin, t_near: 0.0, direction, t_far: f32::INFINITY })
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
