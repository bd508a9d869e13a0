//! The denoised image that the reconstruction is pulled to, and its estimated error.

use super::form::Form;
use super::level::Level;
use crate::error::{Error, Result};
use crate::film::{Frame, Layer};
use crate::image::nl_means::rdfc::{self, Denoised};
use crate::image::nl_means::{Guide, Guides};
use crate::image::oidn;
use crate::reconstruct::features::Feature;
use crate::reconstruct::inputs::Inputs;
use crate::reconstruct::oidn::clean;
use crate::reconstruct::residual::{noise, squared_error};

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
            // The level's variances may have been raised, which makes the error less.
            Ok(Denoised { error: squared_error(&level.color, &noise(&level.variance), &image), image })
        }
    }
}
