//! Textures: linear colour as a function of texture coordinates. v counts downwards in image files.

pub mod bitmap;
mod checkerboard;
mod mesh_attribute;
mod plugins;
mod scale;
pub mod spectra;
mod texels;
mod unbound;
mod uniform;

pub use self::plugins::PLUGINS;
pub use self::texels::{Memory, Selection, Texels};
pub use self::unbound::{Unbound, bind};
use crate::math::{Rgb, Vec2, luminance};

/// A point of a shape, as textures see it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Point {
    /// Texture coordinates.
    pub uv: Vec2,
    /// Weights of the triangle's second and third corner.
    pub barycentric: Vec2,
    /// Number of the triangle.
    pub primitive: u32,
    /// Number of the shape.
    pub shape: u32,
}

/// A colour or a number over a surface.
pub trait Texture: Send + Sync {
    /// Linear colour at a point.
    fn color(&self, at: &Point) -> Rgb;

    /// The colour as one number: its luminance for images, its mean for constants.
    fn scalar(&self, at: &Point) -> f32 {
        luminance(self.color(at))
    }

    /// Has whatever a look-up at a point needs brought into the cache.
    fn prefetch(&self, _at: &Point) {}

    /// Change of [`Texture::scalar`] per u and per v.
    fn gradient(&self, _at: &Point) -> Vec2 {
        Vec2::ZERO
    }

    /// Average of [`Texture::scalar`] over the unit square; steers sampling only.
    fn mean(&self) -> f32;

    /// Columns and rows, of an image.
    fn resolution(&self) -> Option<Vec2> {
        None
    }

    /// Largest value of every channel, or an upper bound of it.
    fn largest(&self) -> Rgb {
        self.constant().unwrap_or(Rgb::ONE)
    }

    /// The colour, if it is the same everywhere.
    fn constant(&self) -> Option<Rgb> {
        None
    }
}

/// The same colour everywhere.
pub struct Constant(pub Rgb);

impl Texture for Constant {
    fn color(&self, _at: &Point) -> Rgb {
        self.0
    }

    fn scalar(&self, _at: &Point) -> f32 {
        self.0.element_sum() / 3.0
    }

    fn mean(&self) -> f32 {
        self.0.element_sum() / 3.0
    }

    fn constant(&self) -> Option<Rgb> {
        Some(self.0)
    }
}

/// The part of a `to_uv` transform that acts on texture coordinates.
#[derive(Clone, Copy)]
struct UvTransform {
    u: Vec2,
    v: Vec2,
    origin: Vec2,
}

impl UvTransform {
    fn apply(&self, uv: Vec2) -> Vec2 {
        self.u * uv.x + self.v * uv.y + self.origin
    }
}
