//! The part of a film that is rendered.

use crate::error::Result;
use crate::math::{Vec2, vec2};
use crate::scene::load::props::{Object, Value};

/// A window of the full film.
#[derive(Clone, Copy, Debug)]
pub struct FilmWindow {
    /// Pixels of the window.
    pub size: (usize, usize),
    /// The window's upper left corner, as a share of the full film.
    origin: Vec2,
    /// The window's width and height, as a share of the full film.
    pub extent: Vec2,
}

impl Default for FilmWindow {
    fn default() -> Self {
        Self { size: (768, 576), origin: Vec2::ZERO, extent: Vec2::ONE }
    }
}

impl FilmWindow {
    /// Size and crop window. The output's format is the command line's to say, and pixels are means over their
    /// squares: gradients between pixels are only defined for the box filter.
    pub fn load(object: &Object) -> Result<Self> {
        let dimension = |name: &str, default| {
            let value = object.integer(name, default)?;
            usize::try_from(value).map_err(|_| object.loc_of(name).invalid(format!("`{name}` cannot be negative")))
        };
        let (width, height) = (dimension("width", 768)?, dimension("height", 576)?);
        let (x, y) = (dimension("crop_offset_x", 0)?, dimension("crop_offset_y", 0)?);
        let rest = |size: usize, offset: usize| size.saturating_sub(offset) as i64;
        let size = (dimension("crop_width", rest(width, x))?, dimension("crop_height", rest(height, y))?);
        let fits = |offset: usize, crop: usize, full: usize| offset.checked_add(crop).is_some_and(|end| end <= full);
        if !fits(x, size.0, width) || !fits(y, size.1, height) {
            let what = format!("a crop window of {}x{} at {x},{y} in a film of {width}x{height}", size.0, size.1);
            return Err(object.loc.invalid(what));
        }
        object.ignore(&[
            "file_format",
            "pixel_format",
            "component_format",
            "banner",
            "high_quality_edges",
            "sample_border",
            "gamma",
            "exposure",
            "tonemap_method",
            "compensate",
        ]);
        for property in object.nested() {
            if let Value::Object(filter) = &property.value {
                property.take();
                if filter.class != "rfilter" {
                    return Err(filter.loc.unsupported(format!("a {} in a film", filter.class)));
                }
            }
        }
        object.all_used(
            "width, height, crop_width, crop_height, crop_offset_x, crop_offset_y, file_format, pixel_format, \
             component_format, rfilter (taken as box)",
        )?;
        let full = vec2(width.max(1) as f32, height.max(1) as f32);
        let window = vec2(size.0.max(1) as f32, size.1.max(1) as f32);
        Ok(Self { size, origin: vec2(x as f32, y as f32) / full, extent: window / full })
    }

    /// A point of the window as a point of the full film, both in [0, 1]².
    pub fn position(&self, at: Vec2) -> Vec2 {
        self.origin + at * self.extent
    }
}
