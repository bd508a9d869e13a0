//! A texture times a colour or a number.

use std::sync::Arc;

use super::{Point, Texture};
use crate::error::Result;
use crate::math::{Rgb, Vec2};
use crate::scene::plugin::{Loader, Object, Plugin};

/// `scale`: a nested texture under any name, or the colour `value`.
pub const PLUGIN: Plugin<Arc<dyn Texture>> =
    Plugin { name: "scale", parameters: "scale = 1, one nested texture or value", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Texture>> {
    let scale = object.color("scale", Rgb::ONE)?;
    let nested = match object.get("value") {
        Some(_) => loader.texture(object, "value", Rgb::ONE)?,
        None => loader.nested_texture(object)?,
    };
    Ok(Arc::new(Scaled { nested, scale }))
}

struct Scaled {
    nested: Arc<dyn Texture>,
    scale: Rgb,
}

impl Scaled {
    fn grey(&self) -> f32 {
        self.scale.element_sum() / 3.0
    }
}

impl Texture for Scaled {
    fn color(&self, at: &Point) -> Rgb {
        self.nested.color(at) * self.scale
    }

    fn scalar(&self, at: &Point) -> f32 {
        self.nested.scalar(at) * self.grey()
    }

    fn prefetch(&self, at: &Point) {
        self.nested.prefetch(at);
    }

    fn gradient(&self, at: &Point) -> Vec2 {
        self.nested.gradient(at) * self.grey()
    }

    fn mean(&self) -> f32 {
        self.nested.mean() * self.grey()
    }

    fn largest(&self) -> Rgb {
        self.nested.largest() * self.scale
    }

    fn constant(&self) -> Option<Rgb> {
        self.nested.constant().map(|color| color * self.scale)
    }
}
