//! The denoised image that the reconstruction is pulled to, and its estimated error.

use super::form::Form;
use super::level::Level;
use crate::error::{Error, Result};
use crate::film::{Frame, Layer};
use crate::image::nl_means::rdfc::{self, Denoised};
use crate::image::nl_means::{Guide, Guides};
use crate::image::oidn;
use crate::image::planes::Planes;
use crate::reconstruct::features::Feature;
use crate::reconstruct::inputs::Inputs;
use crate::reconstruct::oidn::clean;

/// A choice of the denoised image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Denoiser {
    /// Non-local means by colour and features.
    Rdfc,
    /// Open Image Denoise.
    Oidn,
}

impl std::str::FromStr for Denoiser {
    type Err = Error;

    /// Fails if the denoiser has to be installed and is not.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "oidn" => oidn::check().map(|()| Self::Oidn),
            _ => Ok(Self::Rdfc),
        }
    }
}

/// Radius of the window that squared residuals are averaged over.
const RESIDUALS: usize = 7;

/// Denoises the colour without gradients, `rows` rows at a time where that is possible.
pub fn denoise(
    denoiser: Denoiser,
    (level, form): (&Level, Form),
    (inputs, frame): (&Inputs, &Frame),
    rows: usize,
    progress: &dyn Fn(f32),
) -> Result<Denoised> {
    match denoiser {
        Denoiser::Rdfc => {
            let color = Guide { mean: level.color.clone(), variance: level.variance.sum(), tolerance: None };
            let guides = Guides { color, features: level.features.iter().map(Feature::guide).collect() };
            let (window, choice) = (form.window(), form.choice());
            let options = rdfc::Options { window, symmetric: form == Form::Code, choice, rows };
            Ok(rdfc::denoise(&guides, options, progress))
        }
        Denoiser::Oidn => {
            let image = inputs.mirrored(&clean(frame, true, frame.get(Layer::Direct))?, inputs.scale);
            Ok(Denoised { error: residual_error(&level.color, &level.variance, &image), image })
        }
    }
}

/// Largest distance that counts: its square and sums of those are still floats.
const MOST: f32 = 1e15;

/// Squared error of an image, mean over the channels: its squared distances from the sampled colours less the noise of these,
/// averaged over a window. With the samples' variances it is unbiased as far as the image's errors have nothing to do with
/// the colours' noise; the level's may have been raised, which makes it less. May be negative.
fn residual_error(color: &Planes, variance: &Planes, image: &Planes) -> Planes {
    let square = color.zip(image, |color, image| (color - image).clamp(-MOST, MOST).powi(2));
    let excess = square.zip(variance, |square, variance| square - variance.min(MOST * MOST));
    excess.sum().map(|sum| sum / 3.0).box_mean(RESIDUALS)
}
