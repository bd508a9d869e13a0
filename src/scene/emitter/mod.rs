//! Emitters. Each can draw a point that lights a position, say how likely it was to draw a point, and how much
//! radiance a point sends: three functions of the point, so that any point can be looked at from anywhere.

mod area;
mod constant;
mod envmap;

pub use self::area::Area;
use super::load::Plugin;
use super::{Bounds, Surface};
use crate::math::{Rgb, Vec2, Vec3};

/// The emitters that stand by themselves in scene files. (`area` stands in a shape.)
pub const PLUGINS: &[Plugin<Box<dyn Emitter>>] = &[envmap::PLUGIN, constant::PLUGIN];

/// Where light starts.
#[derive(Clone, Copy, Debug)]
pub enum Position {
    /// A point of a surface with its unit normal.
    Surface {
        /// Position.
        p: Vec3,
        /// Normal on the emitting side.
        n: Vec3,
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
    /// Where it is.
    pub position: Position,
    /// Texture coordinates on its shape.
    pub uv: Vec2,
    /// Number of its emitter.
    pub emitter: u32,
}

impl LightPoint {
    /// A surface that was hit, as a point of its emitter.
    pub fn on_surface(surface: &Surface, emitter: u32) -> Self {
        let position = Position::Surface { p: surface.p, n: surface.n };
        Self { position, uv: surface.uv, emitter }
    }

    /// The environment in a direction.
    pub fn at_infinity(direction: Vec3, emitter: u32) -> Self {
        Self { position: Position::Infinity { direction }, uv: Vec2::ZERO, emitter }
    }

    /// Unit direction from `from` towards the point.
    #[inline]
    pub fn direction(&self, from: Vec3) -> Vec3 {
        match self.position {
            Position::Surface { p, .. } => (p - from).normalize_or_zero(),
            Position::Infinity { direction } => direction,
        }
    }

    /// A density per area as one per solid angle at `from`; 0 from behind.
    pub fn area_to_solid_angle(&self, from: Vec3, density: f32) -> f32 {
        let factor = self.solid_angle(from);
        if factor > 0.0 { density / factor } else { 0.0 }
    }

    /// Solid angle at `from` per area around the point: |cos θ| / d² on its emitting side, else 0. At infinity
    /// it is 1 from everywhere.
    #[inline]
    pub fn solid_angle(&self, from: Vec3) -> f32 {
        match self.position {
            Position::Surface { p, n, .. } => {
                let to = from - p;
                let distance_squared = to.length_squared();
                let cos = n.dot(to) / distance_squared.sqrt();
                if cos > 0.0 { cos / distance_squared } else { 0.0 }
            }
            Position::Infinity { .. } => 1.0,
        }
    }
}

/// A source of light.
pub trait Emitter: Send + Sync {
    /// A point to light `from` with; its emitter number is left to the scene.
    fn sample(&self, from: Vec3, u: Vec2) -> Option<LightPoint>;

    /// Density of [`Emitter::sample`] per solid angle at `from`.
    fn pdf(&self, from: Vec3, point: &LightPoint) -> f32;

    /// Radiance sent by `point` along `direction`, which points away from the emitter.
    fn radiance(&self, point: &LightPoint, direction: Vec3) -> Rgb;

    /// Emitted power, for choosing among emitters; a rough figure will do, but 0 only for no light at all.
    fn power(&self) -> f32;

    /// Told once what the emitter lights, for those that surround it.
    fn enclose(&mut self, _scene: Bounds) {}

    /// The plugin's name.
    fn name(&self) -> &'static str;
}
