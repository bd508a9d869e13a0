//! Two colours in squares; the pattern repeats with every unit of u and v.

use std::sync::Arc;

use super::{Point, Texture, UvTransform};
use crate::error::Result;
use crate::math::{Rgb, Vec2};
use crate::scene::plugin::{Loader, Object, Plugin};

/// `checkerboard`.
pub const PLUGIN: Plugin<Arc<dyn Texture>> =
    Plugin { name: "checkerboard", parameters: "color0 = 0.4, color1 = 0.2, to_uv", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Texture>> {
    Ok(Arc::new(Checkerboard {
        colors: [
            loader.texture(object, "color0", Rgb::splat(0.4))?,
            loader.texture(object, "color1", Rgb::splat(0.2))?,
        ],
        to_uv: UvTransform::load(object)?,
    }))
}

struct Checkerboard {
    colors: [Arc<dyn Texture>; 2],
    to_uv: UvTransform,
}

impl Checkerboard {
    /// Parity of the square that contains a point: 0 for the square at the origin, 1 for its neighbours.
    fn square(&self, at: &Point) -> usize {
        let cell = self.to_uv.apply(at.uv);
        let half = (cell - cell.floor()).cmpgt(Vec2::splat(0.5));
        usize::from(half.test(0) != half.test(1))
    }
}

impl Texture for Checkerboard {
    fn color(&self, at: &Point) -> Rgb {
        self.colors[self.square(at)].color(at)
    }

    /// Used as a number, the squares are swapped: so Mitsuba 3 has it, and the files of the field rely on it.
    fn scalar(&self, at: &Point) -> f32 {
        self.colors[1 - self.square(at)].scalar(at)
    }

    fn mean(&self) -> f32 {
        0.5 * (self.colors[0].mean() + self.colors[1].mean())
    }
}
