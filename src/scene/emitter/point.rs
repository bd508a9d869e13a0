//! Light from a single point, the same in all directions.

use std::f32::consts::PI;

use super::{Emitter, Extent, LightPoint, Position};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::Bounds;
use crate::scene::plugin::{Loader, Object, Plugin};

/// `point`.
pub const PLUGIN: Plugin<Box<dyn Emitter>> =
    Plugin { name: "point", parameters: "position = 0 or to_world, intensity = 1", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Box<dyn Emitter>> {
    if object.get("position").is_some() && object.get("to_world").is_some() {
        return Err(object.loc_of("position").invalid("give either `position` or `to_world`"));
    }
    let origin = loader.to_world(object)?.transform_point3(Vec3::ZERO);
    let position = loader.position(object, "position", origin)?;
    Ok(Box::new(Point { position, intensity: loader.uniform_radiance(object, "intensity")? }))
}

struct Point {
    position: Vec3,
    /// Power per solid angle.
    intensity: Rgb,
}

impl Emitter for Point {
    fn sample(&self, _from: Vec3, _u: Vec2) -> Option<LightPoint> {
        Some(LightPoint::only(Position::Point { p: self.position }))
    }

    fn radiance(&self, _point: &LightPoint, _direction: Vec3) -> Rgb {
        self.intensity
    }

    fn power(&self) -> f32 {
        4.0 * PI * self.intensity.max_element().max(0.0)
    }

    fn extent(&self) -> Option<Extent> {
        Some(Extent { bounds: Bounds::of([self.position]), axis: Vec3::Z, spread: PI, reach: 0.5 * PI })
    }

    fn name(&self) -> &'static str {
        "point"
    }
}
