//! The part of a film that is rendered.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

use crate::error::{Error, Result};
use crate::image::io::DataWindow;
use crate::math::{Vec2, vec2};
use crate::scene::plugin::{Loader, Object};

/// A rectangle of pixels of the full film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Crop {
    /// Column of its first pixel.
    pub x: usize,
    /// Row of its first pixel.
    pub y: usize,
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Crop {
    /// Columns and rows of its pixels, row by row.
    pub fn pixels(self) -> impl Iterator<Item = (usize, usize)> {
        (self.y..self.y + self.height).flat_map(move |y| (self.x..self.x + self.width).map(move |x| (x, y)))
    }

    /// Its window in the whole picture, as a part of an image of some size that may be a part of that picture, too.
    pub fn within(self, window: Option<DataWindow>, size: (usize, usize)) -> DataWindow {
        let DataWindow { origin: (x, y), full } = window.unwrap_or(DataWindow { origin: (0, 0), full: size });
        DataWindow { origin: (x + self.x, y + self.y), full }
    }
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{}x{}", self.x, self.y, self.width, self.height)
    }
}

/// A window of the full film.
#[derive(Clone, Copy, Debug)]
pub struct FilmWindow {
    /// Pixels of the window.
    pub size: (usize, usize),
    /// Whether the file asks for an alpha channel.
    pub alpha: bool,
    /// The window's upper left corner, as a share of the full film.
    origin: Vec2,
    /// The window's width and height, as a share of the full film.
    pub extent: Vec2,
    /// The window in pixels and the size of the full film, where it is a part of it.
    pub part: Option<(Crop, (usize, usize))>,
    /// The part of the window that is wanted, in its pixels, where more is rendered.
    pub inner: Option<Crop>,
}

impl Default for FilmWindow {
    fn default() -> Self {
        Self { size: (768, 576), alpha: false, origin: Vec2::ZERO, extent: Vec2::ONE, part: None, inner: None }
    }
}

impl FilmWindow {
    /// The film of a file, or the default one, with other numbers of pixels or another window of it.
    pub fn load(
        object: Option<&Object>,
        loader: &dyn Loader,
        size: Option<(usize, usize)>,
        crop: Option<Crop>,
    ) -> Result<Self> {
        let film = object.map_or(Ok(Self::default()), |object| Self::of_object(object, loader))?;
        if let Some(crop) = crop {
            let full = size.unwrap_or(film.part.map_or(film.size, |(_, full)| full));
            return Ok(Self { alpha: film.alpha, ..Self::new(full, crop)? });
        }
        Ok(match size {
            // Of a part in other numbers of pixels there need not be whole numbers of them before it.
            Some(size) => Self { size, part: None, ..film },
            None => film,
        })
    }

    fn new(full: (usize, usize), crop: Crop) -> Result<Self> {
        let fits = |offset: usize, crop: usize, full: usize| offset.checked_add(crop).is_some_and(|end| end <= full);
        if !fits(crop.x, crop.width, full.0) || !fits(crop.y, crop.height, full.1) {
            let (Crop { x, y, width, height }, (full_width, full_height)) = (crop, full);
            let what = format!("a crop window of {width}x{height} at {x},{y} in a film of {full_width}x{full_height}");
            return Err(Error::Usage(what));
        }
        let film = vec2(full.0.max(1) as f32, full.1.max(1) as f32);
        let window = vec2(crop.width.max(1) as f32, crop.height.max(1) as f32);
        Ok(Self {
            size: (crop.width, crop.height),
            origin: vec2(crop.x as f32, crop.y as f32) / film,
            extent: window / film,
            part: (full != (crop.width, crop.height)).then_some((crop, full)),
            ..Self::default()
        })
    }

    /// Size and crop window. The output's format is the command line's to say, and pixels are means over their
    /// squares: gradients between pixels are only defined for the box filter.
    fn of_object(object: &Object, loader: &dyn Loader) -> Result<Self> {
        let dimension = |name: &str, default| {
            let value = object.integer(name, default)?;
            usize::try_from(value).map_err(|_| object.loc_of(name).invalid(format!("`{name}` cannot be negative")))
        };
        let (width, height) = (dimension("width", 768)?, dimension("height", 576)?);
        let (x, y) = (dimension("crop_offset_x", 0)?, dimension("crop_offset_y", 0)?);
        let rest = |size: usize, offset: usize| size.saturating_sub(offset) as i64;
        let crop = Crop {
            x,
            y,
            width: dimension("crop_width", rest(width, x))?,
            height: dimension("crop_height", rest(height, y))?,
        };
        let window = Self::new((width, height), crop).map_err(|error| object.loc.invalid(error.to_string()))?;
        let format = object.string("pixel_format", "rgb")?.to_lowercase();
        if !["rgb", "rgba", "multichannel"].contains(&format.as_str()) {
            let what = format!("images are written in RGB, not as `{format}`");
            loader.warn(&object.loc_of("pixel_format"), &what)?;
        }
        if object.float("exposure", 0.0)? != 0.0 {
            loader.warn(&object.loc_of("exposure"), "the film's `exposure` is ignored: give it with --exposure")?;
        }
        object.ignore(IGNORED);
        for property in object.nested() {
            let nested = loader.resolve(property)?;
            // Any reconstruction filter is taken as a box.
            if nested.class == "rfilter" {
                property.take();
            }
        }
        loader.warn_unused(object)?;
        Ok(Self { alpha: format.ends_with('a') && format != "multichannel", ..window })
    }

    /// The window with up to so many pixels more on every side, as far as the full film goes.
    pub fn with_overscan(self, pixels: usize) -> Result<Self> {
        if pixels > 0 && self.part.is_none() && self.extent != Vec2::ONE {
            let what = "overscan around the file's own part of the film in other numbers of pixels: give --crop";
            return Err(Error::Usage(what.into()));
        }
        let Some((crop, full)) = self.part.filter(|_| pixels > 0) else { return Ok(self) };
        let (x, y) = (crop.x.saturating_sub(pixels), crop.y.saturating_sub(pixels));
        let end = |at: usize, size: usize, full: usize| (at + size).saturating_add(pixels).min(full);
        let (right, bottom) = (end(crop.x, crop.width, full.0), end(crop.y, crop.height, full.1));
        let larger = Self::new(full, Crop { x, y, width: right - x, height: bottom - y })?;
        Ok(Self { alpha: self.alpha, inner: Some(Crop { x: crop.x - x, y: crop.y - y, ..crop }), ..larger })
    }

    /// A point of the window as a point of the full film, both in [0, 1]².
    pub fn position(&self, at: Vec2) -> Vec2 {
        self.origin + at * self.extent
    }
}

/// Properties of films that say how files are written.
const IGNORED: &[&str] = &[
    "file_format",
    "component_format",
    "banner",
    "high_quality_edges",
    "sample_border",
    "gamma",
    "tonemap_method",
    "compensate",
    "attach_log",
    "size",
    "variable",
    "digits",
    "key",
    "burn",
    "label",
];
