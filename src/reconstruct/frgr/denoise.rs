//! The denoised image that the reconstruction is pulled to, and its estimated error.

use super::form::Form;
use super::level::Level;
use crate::image::Image;
use crate::image::nl_means::rdfc::{self, Denoised};
use crate::image::nl_means::{Guide, Guides};
use crate::reconstruct::common::features::Feature;
use crate::reconstruct::common::inputs::Inputs;
use crate::reconstruct::common::residual::{noise, squared_error};

/// The colour denoised by non-local means, `rows` rows at a time.
pub fn by_means(level: &Level, form: Form, rows: usize, report: &dyn Fn(f32)) -> Denoised {
    let color = Guide { mean: level.color.clone(), variance: level.variance.sum(), tolerance: None };
    let guides = Guides { color, features: level.features.iter().map(Feature::guide).collect() };
    let (window, choice) = (form.window(), form.choice());
    rdfc::denoise(&guides, rdfc::Options { window, symmetric: form == Form::Code, choice, rows }, report)
}

/// An image of another method, with its error by the sampled colours. Variances of the level may have been raised, which makes the error
/// less.
pub fn judged(level: &Level, inputs: &Inputs, image: &Image) -> Denoised {
    let image = inputs.mirrored(image, inputs.scale);
    Denoised { error: squared_error(&level.color, &noise(&level.variance), &image), image }
}
