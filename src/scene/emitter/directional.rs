//! Parallel light from infinitely far away, like the sun without its disk.

use super::{Emitter, LightPoint, Position};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::Bounds;
use crate::scene::plugin::{Loader, Object, Plugin};

/// `directional`: shines along `direction`, or along +z of `to_world`.
pub const PLUGIN: Plugin<Box<dyn Emitter>> =
    Plugin { name: "directional", parameters: "direction = +z or to_world, irradiance = 1", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Box<dyn Emitter>> {
    if object.get("direction").is_some() && object.get("to_world").is_some() {
        return Err(object.loc_of("direction").invalid("give either `direction` or `to_world`"));
    }
    let along = object.transform("to_world")?.transform_vector3(Vec3::Z);
    let direction = object.vector("direction", along)?.try_normalize();
    let direction = direction.ok_or_else(|| object.loc_of("direction").invalid("`direction` has length zero"))?;
    Ok(Box::new(Directional { direction, irradiance: loader.uniform_radiance(object, "irradiance")?, area: 1.0 }))
}

struct Directional {
    /// Direction that the light travels along.
    direction: Vec3,
    /// Power per area across the direction.
    irradiance: Rgb,
    /// Cross-section of the scene.
    area: f32,
}

impl Emitter for Directional {
    fn sample(&self, _from: Vec3, _u: Vec2) -> Option<LightPoint> {
        Some(LightPoint::only(Position::Infinity { direction: -self.direction }))
    }

    fn pdf(&self, _from: Vec3, _point: &LightPoint) -> f32 {
        1.0
    }

    fn radiance(&self, _point: &LightPoint, _direction: Vec3) -> Rgb {
        self.irradiance
    }

    fn power(&self) -> f32 {
        self.area * self.irradiance.max_element().max(0.0)
    }

    fn enclose(&mut self, scene: Bounds) {
        self.area = scene.cross_section();
    }

    fn name(&self) -> &'static str {
        "directional"
    }
}
