//! A cone of light from a single point, with a soft rim and an optional slide.

use std::f32::consts::TAU;
use std::sync::Arc;

use super::apex::Apex;
use super::{Emitter, Extent, LightPoint};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, vec2};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{self, Texture};

/// `spot`: shines along +z of `to_world`. Angles are in degrees, from the axis.
pub const PLUGIN: Plugin<Box<dyn Emitter>> = Plugin {
    name: "spot",
    parameters: "intensity = 1, texture, cutoff_angle = 20, beam_width = 3/4 cutoff_angle, to_world",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Box<dyn Emitter>> {
    let cutoff = object.float("cutoff_angle", 20.0)?;
    let beam = object.float("beam_width", 0.75 * cutoff)?;
    if !(cutoff > 0.0 && cutoff <= 90.0 && (0.0..=cutoff).contains(&beam)) {
        let what = format!("a cone of {cutoff} degrees around a beam of {beam}; needed: 0 <= beam <= cone <= 90");
        return Err(object.loc_of("cutoff_angle").invalid(what));
    }
    Ok(Box::new(Spot {
        apex: Apex::load(object, loader)?,
        intensity: loader.uniform_radiance(object, "intensity")?,
        slide: loader.texture(object, "texture", Rgb::ONE)?,
        cutoff: cutoff.to_radians(),
        beam: beam.to_radians(),
    }))
}

struct Spot {
    apex: Apex,
    /// Power per solid angle on the axis.
    intensity: Rgb,
    /// Colours the light; its unit square spans the cone.
    slide: Arc<dyn Texture>,
    cutoff: f32,
    /// Full intensity up to this angle, then falling linearly to the cutoff.
    beam: f32,
}

impl Emitter for Spot {
    fn sample(&self, _from: Vec3, _u: Vec2) -> Option<LightPoint> {
        Some(self.apex.point())
    }

    fn radiance(&self, _point: &LightPoint, direction: Vec3) -> Rgb {
        let local = self.apex.local(direction);
        let angle = local.z.clamp(-1.0, 1.0).acos();
        if local == Vec3::ZERO || angle >= self.cutoff {
            return Rgb::ZERO;
        }
        let falloff = if angle <= self.beam { 1.0 } else { (self.cutoff - angle) / (self.cutoff - self.beam) };
        let uv = 0.5 + 0.5 * vec2(local.x, local.y) / (local.z * self.cutoff.tan());
        self.intensity * self.slide.color(&texture::Point { uv, ..texture::Point::default() }) * falloff
    }

    fn power(&self) -> f32 {
        // 1 - cos α as 2 sin² α/2: the narrowest cone has some power.
        let cone = 2.0 * TAU * (0.25 * (self.cutoff + self.beam)).sin().powi(2);
        cone * self.intensity.max_element().max(0.0) * self.slide.mean().max(0.0)
    }

    fn extent(&self) -> Option<Extent> {
        Some(self.apex.extent(self.cutoff))
    }

    fn name(&self) -> &'static str {
        "spot"
    }
}
