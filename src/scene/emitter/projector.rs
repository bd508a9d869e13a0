//! A slide projector: an image thrown from a point.

use std::f32::consts::PI;
use std::sync::Arc;

use super::{Emitter, Extent, LightPoint, Position};
use crate::error::Result;
use crate::math::{Mat4, Rgb, Vec2, Vec3, vec2};
use crate::scene::Bounds;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::sensor;
use crate::scene::texture::{self, Texture};

/// `projector`: shines along +z of `to_world`, with the image's first column to the left, seen from the projector.
pub const PLUGIN: Plugin<Box<dyn Emitter>> = Plugin {
    name: "projector",
    parameters: "irradiance = 1, scale = 1, fov or focal_length = 50mm, fov_axis = x (y, diagonal, smaller, larger), \
        to_world",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Box<dyn Emitter>> {
    let slide = loader.radiance(object, "irradiance")?;
    let aspect = slide.resolution().map_or(1.0, |size| size.x / size.y);
    let half_width = sensor::half_width(object, aspect)?;
    let to_world = object.transform("to_world")?;
    Ok(Box::new(Projector {
        position: to_world.transform_point3(Vec3::ZERO),
        to_local: to_world.inverse(),
        slide,
        scale: object.float("scale", 1.0)?,
        half_extent: vec2(half_width, half_width / aspect),
    }))
}

struct Projector {
    position: Vec3,
    to_local: Mat4,
    /// Irradiance at distance one, across the unit square.
    slide: Arc<dyn Texture>,
    scale: f32,
    /// Half the picture's width and height at distance one.
    half_extent: Vec2,
}

impl Emitter for Projector {
    fn sample(&self, _from: Vec3, _u: Vec2) -> Option<LightPoint> {
        Some(LightPoint::only(Position::Point { p: self.position }))
    }

    fn pdf(&self, from: Vec3, point: &LightPoint) -> f32 {
        point.area_to_solid_angle(from, 1.0)
    }

    /// Power per solid angle.
    fn radiance(&self, _point: &LightPoint, direction: Vec3) -> Rgb {
        let local = self.to_local.transform_vector3(direction).normalize_or_zero();
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
        let axis = self.to_local.inverse().transform_vector3(Vec3::Z).normalize_or(Vec3::Z);
        let reach = self.half_extent.length().atan();
        Some(Extent { bounds: Bounds::of([self.position]), axis, spread: 0.0, reach })
    }

    fn name(&self) -> &'static str {
        "projector"
    }
}
