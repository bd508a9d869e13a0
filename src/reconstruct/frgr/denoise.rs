//! The denoised image that the reconstruction is pulled to, and its estimated error.

use super::form::Form;
use super::level::Level;
use crate::error::{Error, Result};
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::image::nl_means::rdfc::{self, Denoised};
use crate::image::nl_means::{Guide, Guides};
use crate::image::oidn::{self, Features, Quality};
use crate::reconstruct::features::Feature;
use crate::reconstruct::inputs::{Inputs, NET_BYTES};
use crate::reconstruct::oidn::clean;
use crate::reconstruct::residual::{noise, squared_error};
use crate::reconstruct::{Context, parse};

/// A choice of the denoised image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Denoiser {
    /// Non-local means by colour and features.
    Rdfc,
    /// Open Image Denoise.
    Oidn,
    /// The trained network of `net`.
    Net,
}

impl std::str::FromStr for Denoiser {
    type Err = Error;

    /// Fails if the denoiser has to be installed and is not.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "oidn" => oidn::check().map(|()| Self::Oidn),
            "net" => Ok(Self::Net),
            _ => Ok(Self::Rdfc),
        }
    }
}

impl Denoiser {
    /// Bytes that it needs besides the frame, if it cannot do with any.
    pub fn bytes(self, frame: &Frame) -> u64 {
        let pixels = (frame.width * frame.height) as u64;
        if matches!(self, Self::Net) { NET_BYTES * pixels } else { 0 }
    }
}

/// Denoises the colour, by non-local means `rows` rows at a time.
pub fn denoise(
    denoiser: Denoiser,
    (level, form): (&Level, Form),
    (inputs, frame): (&Inputs, &Frame),
    rows: usize,
    context: &Context,
) -> Result<Denoised> {
    // The level's variances may have been raised, which makes the error less.
    let judged = |image: Image| {
        let image = inputs.mirrored(&image, inputs.scale);
        Denoised { error: squared_error(&level.color, &noise(&level.variance), &image), image }
    };
    match denoiser {
        Denoiser::Rdfc => {
            let color = Guide { mean: level.color.clone(), variance: level.variance.sum(), tolerance: None };
            let guides = Guides { color, features: level.features.iter().map(Feature::guide).collect() };
            let (window, choice) = (form.window(), form.choice());
            let options = rdfc::Options { window, symmetric: form == Form::Code, choice, rows };
            Ok(rdfc::denoise(&guides, options, &|share| (context.progress)("denoise", share)))
        }
        Denoiser::Oidn => {
            let networks = (Quality::High, Features::Prefiltered(Quality::Balanced));
            clean(frame, frame.get(Layer::Direct), networks, context.memory).map(judged)
        }
        Denoiser::Net => parse("net:image=safe")?.reconstruct(frame, context).map(|solution| judged(solution.image)),
    }
}
