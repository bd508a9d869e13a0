//! A slide projector: an image thrown from a point.

use std::f32::consts::PI;
use std::sync::Arc;

use super::apex::Apex;
use super::{Emitter, Extent, LightPoint};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, vec2};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::sensor;
use crate::scene::texture::{self, Texture};

/// `projector`: shines along +z of `to_world`, with the image's first column to the left, seen from the projector.
pub const PLUGIN: Plugin<Box<dyn Emitter>> = Plugin {
    name: "projector",
    parameters: "irradiance = 1, scale = 1, fov or focal_length = 50mm, fov_axis = x (y, diagonal, smaller, larger), \
        to_world",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Box<dyn Emitter>> {
    let slide = loader.radiance(object, "irradiance")?;
    let aspect = slide.resolution().map_or(1.0, |size| size.x / size.y);
    let half_width = sensor::half_width(object, aspect)?;
    Ok(Box::new(Projector {
        apex: Apex::load(object, loader)?,
        slide,
        scale: object.float("scale", 1.0)?,
        half_extent: vec2(half_width, half_width / aspect),
    }))
}

struct Projector {
    apex: Apex,
    /// Irradiance at distance one, across the unit square.
    slide: Arc<dyn Texture>,
    scale: f32,
    /// Half the picture's width and height at distance one.
    half_extent: Vec2,
}

impl Emitter for Projector {
    fn sample(&self, _from: Vec3, _u: Vec2) -> Option<LightPoint> {
        Some(self.apex.point())
    }

    /// Power per solid angle.
    fn radiance(&self, _point: &LightPoint, direction: Vec3) -> Rgb {
        let local = self.apex.local(direction);
        if local.z <= 0.0 {
            return Rgb::ZERO;
        }
        let at = vec2(local.x, local.y) / local.z / self.half_extent;
        if at.abs().max_element() > 1.0 {
            return Rgb::ZERO;
        }
        let uv = 0.5 - 0.5 * at;
        // The picture is as bright as its slide where it falls onto a plane at distance one.
        let color = self.slide.color(&texture::Point { uv, ..texture::Point::default() });
        color * (PI * self.scale / (local.z * local.z * local.z))
    }

    fn power(&self) -> f32 {
        let solid_angle = 4.0 * self.half_extent.x * self.half_extent.y;
        (PI * self.scale * self.slide.mean().max(0.0) * solid_angle).max(0.0)
    }

    fn extent(&self) -> Option<Extent> {
        Some(self.apex.extent(self.half_extent.length().atan()))
    }

    fn name(&self) -> &'static str {
        "projector"
    }
}
