//! The table of textures, and what several of them read from their objects.

use std::sync::Arc;

use super::{Texture, UvTransform, bitmap, checkerboard, mesh_attribute, scale, spectra, uniform};
use crate::error::Result;
use crate::math::{Mat4, vec2};
use crate::scene::plugin::{Object, Plugin};

/// The textures of scene files.
pub const PLUGINS: &[Plugin<Arc<dyn Texture>>] = &[
    bitmap::PLUGIN,
    checkerboard::PLUGIN,
    mesh_attribute::PLUGIN,
    scale::PLUGIN,
    uniform::UNIFORM,
    uniform::RAW,
    spectra::D65,
    spectra::SRGB,
    spectra::BLACKBODY,
    spectra::REGULAR,
    spectra::IRREGULAR,
];

impl UvTransform {
    /// The property `to_uv`.
    pub(super) fn load(object: &Object) -> Result<Self> {
        let matrix: Mat4 = object.transform("to_uv")?;
        let column = |axis: glam::Vec4| vec2(axis.x, axis.y);
        Ok(Self { u: column(matrix.x_axis), v: column(matrix.y_axis), origin: column(matrix.w_axis) })
    }
}
