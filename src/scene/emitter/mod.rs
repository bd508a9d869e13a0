//! Emitters. Each can draw a point that lights a position, say how likely it was to draw a point, and how much
//! radiance a point sends: three functions of the point, so that any point can be looked at from anywhere.

mod apex;
mod area;
mod choice;
mod constant;
mod directional;
mod envmap;
mod plugins;
mod point;
mod projector;
mod spot;
mod sunsky;
mod tree;

pub use self::area::Area;
pub use self::choice::{Candidate, Choice, Chosen, LightTriangle};
pub use self::envmap::{EnvMap, EnvmapHits};
pub use self::plugins::PLUGINS;
pub use self::tree::{Extent, Receiver};
use super::Bounds;
pub use super::light_point::{LightPoint, Position};
use super::shape::Geometry;
use crate::math::{Rgb, Vec2, Vec3};
use std::sync::Arc;

/// A source of light.
pub trait Emitter: Send + Sync {
    /// Samples a point that may light `from`. The scene sets its emitter index.
    fn sample(&self, from: Vec3, u: Vec2) -> Option<LightPoint>;

    /// Density of [`Emitter::sample`] per solid angle at `from`. By default that of emitters of one point, whose area is taken as one.
    fn pdf(&self, from: Vec3, point: &LightPoint) -> f32 {
        point.area_to_solid_angle(from, 1.0)
    }

    /// Radiance sent by `point` along `direction`, which points away from the emitter.
    fn radiance(&self, point: &LightPoint, direction: Vec3) -> Rgb;

    /// Emitted power, for choosing among emitters; a rough figure will do, but 0 only for no light at all.
    fn power(&self) -> f32;

    /// Bounds of positions and directions of emission; `None` for emitters without a position, and for black ones.
    fn extent(&self) -> Option<Extent> {
        None
    }

    /// Called once with the scene's bounds, for emitters at infinity.
    fn enclose(&mut self, _scene: Bounds) {}

    /// The emitter point of an environment for rays along `direction` that hit nothing. The scene sets its emitter index.
    fn environment_point(&self, direction: Vec3) -> LightPoint {
        LightPoint::at_infinity(direction, 0)
    }

    /// Whether rays that hit nothing end on it.
    fn is_environment(&self) -> bool {
        false
    }

    /// The environment image, if the emitter is one.
    fn envmap(&self) -> Option<&EnvMap> {
        None
    }

    /// Shape and radiance, if the emitter sends the same radiance from everywhere on its outside.
    fn uniform_mesh(&self) -> Option<(&Arc<Geometry>, Rgb)> {
        None
    }

    /// The plugin's name.
    fn name(&self) -> &'static str;
}
