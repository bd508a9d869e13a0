//! Two colours in squares; the pattern repeats with every unit of u and v.

use std::sync::Arc;

use super::{Texture, UvTransform};
use crate::error::Result;
use crate::math::{Rgb, Vec2};
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};

/// `checkerboard`.
pub const PLUGIN: Plugin<Arc<dyn Texture>> = Plugin { name: "checkerboard", parameters: "color0, color1, to_uv", make };

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Texture>> {
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

impl Texture for Checkerboard {
    fn color(&self, uv: Vec2) -> Rgb {
        let cell = self.to_uv.apply(uv);
        let half = (cell - cell.floor()).cmpgt(Vec2::splat(0.5));
        let index = usize::from(half.test(0) != half.test(1));
        self.colors[index].color(uv)
    }

    fn mean(&self) -> f32 {
        0.5 * (self.colors[0].mean() + self.colors[1].mean())
    }
}
