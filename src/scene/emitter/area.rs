//! Area emitters: shapes that emit on their outside.

use std::f32::consts::PI;
use std::sync::Arc;

use super::{Emitter, Extent, LightPoint, Position};
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::shape::Geometry;
use crate::scene::texture::Texture;

/// Equal radiance in every direction on the side of the normal.
pub struct Area {
    geometry: Arc<Geometry>,
    radiance: Arc<dyn Texture>,
    shape: u32,
    /// Whether the radiance varies over the shape.
    textured: bool,
}

impl Area {
    /// An emissive shape and its index.
    pub fn new(geometry: Arc<Geometry>, radiance: Arc<dyn Texture>, shape: u32) -> Self {
        let textured = radiance.constant().is_none();
        Self { geometry, radiance, shape, textured }
    }
}

impl Emitter for Area {
    fn sample(&self, from: Vec3, u: Vec2) -> Option<LightPoint> {
        let mut point = self.geometry.sample(from, u, self.textured)?;
        point.at.shape = self.shape;
        Some(point)
    }

    fn pdf(&self, from: Vec3, point: &LightPoint) -> f32 {
        self.geometry.pdf(from, point)
    }

    fn radiance(&self, point: &LightPoint, direction: Vec3) -> Rgb {
        match point.position {
            Position::Surface { n, .. } if n.dot(direction) > 0.0 => self.radiance.color(&point.at),
            _ => Rgb::ZERO,
        }
    }

    fn power(&self) -> f32 {
        PI * self.geometry.area() * self.radiance.mean().max(0.0)
    }

    fn extent(&self) -> Option<Extent> {
        let (axis, spread) = self.geometry.normals();
        Some(Extent { bounds: self.geometry.bounds(), axis, spread, reach: 0.5 * PI })
    }

    fn uniform_mesh(&self) -> Option<(&Arc<Geometry>, Rgb)> {
        Some((&self.geometry, self.radiance.constant()?))
    }

    fn name(&self) -> &'static str {
        "area"
    }
}
