//! Points of emitters.

use super::{Surface, texture};
use crate::math::Vec3;

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
    /// An isotropic point without extent.
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

    /// A point drawn on a shape; the numbers of the shape and of its emitter are set by the caller.
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
