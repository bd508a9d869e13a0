//! The point that a cone of light comes from, and the frame that it is described in.

use super::{Extent, LightPoint, Position};
use crate::error::Result;
use crate::math::{Mat4, Vec3};
use crate::scene::Bounds;
use crate::scene::plugin::{Loader, Object};

/// The origin of `to_world`, from which light goes along its +z.
pub struct Apex {
    position: Vec3,
    to_local: Mat4,
}

impl Apex {
    /// From the property `to_world`.
    pub fn load(object: &Object, loader: &dyn Loader) -> Result<Self> {
        let to_world = loader.to_world(object)?;
        Ok(Self { position: to_world.transform_point3(Vec3::ZERO), to_local: to_world.inverse() })
    }

    /// The only point that emits.
    pub fn point(&self) -> LightPoint {
        LightPoint::only(Position::Point { p: self.position })
    }

    /// A direction in the local frame; zero if it has none there.
    pub fn local(&self, direction: Vec3) -> Vec3 {
        self.to_local.transform_vector3(direction).normalize_or_zero()
    }

    /// Bounds of light that leaves at angles up to `reach` from the axis.
    pub fn extent(&self, reach: f32) -> Extent {
        let axis = self.to_local.inverse().transform_vector3(Vec3::Z).normalize_or(Vec3::Z);
        Extent { bounds: Bounds::of([self.position]), axis, spread: 0.0, reach }
    }
}
