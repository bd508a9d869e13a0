//! The same radiance from everywhere.

use std::f32::consts::{FRAC_1_PI, PI};

use super::{Emitter, LightPoint};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, warp};
use crate::scene::Bounds;
use crate::scene::plugin::{Loader, Object, Plugin};

/// `constant`.
pub const PLUGIN: Plugin<Box<dyn Emitter>> = Plugin { name: "constant", parameters: "radiance = 1", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Box<dyn Emitter>> {
    Ok(Box::new(Constant { radiance: loader.uniform_radiance(object, "radiance")?, area: 1.0 }))
}

struct Constant {
    radiance: Rgb,
    /// Cross-section of the scene, through which the light comes.
    area: f32,
}

impl Emitter for Constant {
    fn sample(&self, _from: Vec3, u: Vec2) -> Option<LightPoint> {
        Some(LightPoint::at_infinity(warp::sphere(u), 0))
    }

    fn pdf(&self, _from: Vec3, _point: &LightPoint) -> f32 {
        0.25 * FRAC_1_PI
    }

    fn radiance(&self, _point: &LightPoint, _direction: Vec3) -> Rgb {
        self.radiance
    }

    fn power(&self) -> f32 {
        4.0 * PI * self.area * self.radiance.max_element().max(0.0)
    }

    fn enclose(&mut self, scene: Bounds) {
        self.area = scene.cross_section();
    }

    fn is_environment(&self) -> bool {
        true
    }

    fn name(&self) -> &'static str {
        "constant"
    }
}
