//! Robust denoising using feature and colour information (Rousselle et al. 2013) by itself. It needs no gradients.

use super::common::features::{Feature, Kind};
use super::common::inputs::{Inputs, check_memory};
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Needs, Recorded};
use crate::image::nl_means::Guides;
use crate::image::nl_means::rdfc::{self, Denoised, Options};

/// `rdfc`.
pub const METHOD: Method = Method {
    id: "rdfc",
    summary: "three non-local means by colour and features, the best at each pixel; path tracing only, consistent",
    traits: Traits::FILTER,
    parameters: &[
        Parameter { name: "window", default: "5", summary: "radius of the window, 1 to 12 pixels" },
        Parameter { name: "choice", default: "2", summary: "radius that the choice is smoothed over, 1 to 12 pixels" },
    ],
    make,
};

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 400;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let radius = |name| parameters.get(name, "a number from 1 to 12", |radius| (1..=12).contains(radius));
    Ok(Box::new(Rdfc { window: radius("window")?, choice: radius("choice")? }))
}

struct Rdfc {
    window: usize,
    choice: usize,
}

impl Reconstruction for Rdfc {
    fn needs(&self) -> Needs {
        Needs::NONE.with(Recorded::Features)
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let inputs = Inputs::new(frame, 1)?;
        check_memory(frame, context, METHOD.id, BYTES)?;
        let color = inputs.guide()?;
        let features = [Feature::of(Kind::Albedo, &inputs)?.guide(), Feature::of(Kind::Normal, &inputs)?.guide()];
        let options = Options { window: self.window, symmetric: false, choice: self.choice, rows: frame.height };
        let report = |share| (context.progress)("denoise", share);
        let Denoised { image, error } = rdfc::denoise(&Guides { color, features: features.into() }, options, &report);
        Ok(Solution {
            image: image.to_image(frame.width, frame.height, 1.0 / inputs.scale),
            alpha: None,
            error: Some(inputs.error(&error)),
            notes: Vec::new(),
        })
    }
}
