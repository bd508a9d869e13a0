//! Emitters. Each can draw a point that lights a position, say how likely it was to draw a point, and how much
//! radiance a point sends: three functions of the point, so that any point can be looked at from anywhere.

mod apex;
mod area;
mod choice;
mod constant;
mod directional;
mod envmap;
mod point;
mod projector;
mod spot;
mod sunsky;
mod tree;

pub use self::area::Area;
pub use self::choice::Choice;
pub use self::envmap::{EnvMap, EnvmapHits};
pub use self::tree::Extent;
use super::load::Plugin;
use super::shape::Geometry;
use super::{Bounds, Surface, texture};
use crate::math::{Rgb, Vec2, Vec3};
use std::sync::Arc;

/// Emitters that are elements of their own in scene files; `area` is nested in a shape.
pub const PLUGINS: &[Plugin<Box<dyn Emitter>>] = &[
    envmap::PLUGIN,
    sunsky::SUNSKY,
    sunsky::SKY,
    sunsky::SUN,
    constant::PLUGIN,
    point::PLUGIN,
    spot::PLUGIN,
    projector::PLUGIN,
    directional::PLUGIN,
];

/// A point that emits light.
#[derive(Clone, Copy, Debug)]
pub enum Position {
    /// A point of a surface with its unit normal.
    Surface {
        /// Position.
        p: Vec3,
        /// Normal on the emitting side.
        n: Vec3,
    },
    /// A point without extent, which shines like a small sphere that turns the same side to everyone.
    Point {
        /// Position.
        p: Vec3,
    },
    /// Infinitely far away.
    Infinity {
        /// Unit direction towards the light.
        direction: Vec3,
    },
}

/// A point of an emitter.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Position of the point.
    pub position: Position,
    /// Position on its shape.
    pub at: texture::Point,
    /// Number of its emitter.
    pub emitter: u32,
    /// Whether it is the emitter's only point, which no path can hit by scattering.
    pub delta: bool,
}

impl LightPoint {
    /// A surface that was hit, as a point of its emitter.
    pub fn on_surface(surface: &Surface, emitter: u32) -> Self {
        let position = Position::Surface { p: surface.p, n: surface.n };
        Self { position, at: surface.at, emitter, delta: false }
    }

    /// A point drawn on a shape; the numbers of the shape and of its emitter are left to whom they belong to.
    pub fn drawn(position: Position, at: texture::Point) -> Self {
        Self { position, at, emitter: 0, delta: false }
    }

    /// The environment in a direction.
    pub fn at_infinity(direction: Vec3, emitter: u32) -> Self {
        let position = Position::Infinity { direction };
        Self { position, at: texture::Point::default(), emitter, delta: false }
    }

    /// The only point that an emitter has.
    pub fn only(position: Position) -> Self {
        Self { position, at: texture::Point::default(), emitter: 0, delta: true }
    }

    /// A density per area as one per solid angle at `from`; 0 from behind.
    pub fn area_to_solid_angle(&self, from: Vec3, density: f32) -> f32 {
        let factor = self.solid_angle(from);
        if factor > 0.0 { density / factor } else { 0.0 }
    }

    /// Solid angle at `from` per area around the point: |cos θ| / d² on its emitting side, else 0. A point without
    /// extent is seen at cos θ = 1 from everywhere; at infinity the ratio is 1.
    #[inline]
    pub fn solid_angle(&self, from: Vec3) -> f32 {
        match self.position {
            Position::Surface { p, n, .. } => {
                let to = from - p;
                let distance_squared = to.length_squared();
                let cos = n.dot(to) / distance_squared.sqrt();
                if cos > 0.0 { cos / distance_squared } else { 0.0 }
            }
            Position::Point { p } => 1.0 / from.distance_squared(p),
            Position::Infinity { .. } => 1.0,
        }
    }
}

/// A source of light.
pub trait Emitter: Send + Sync {
    /// Samples a point that may light `from`. The scene sets its emitter index.
    fn sample(&self, from: Vec3, u: Vec2) -> Option<LightPoint>;

    /// Density of [`Emitter::sample`] per solid angle at `from`; for an only point, over its area taken as one.
    fn pdf(&self, from: Vec3, point: &LightPoint) -> f32;

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
