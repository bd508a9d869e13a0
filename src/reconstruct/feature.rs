//! The feature generated from differences, as an image: a screened Poisson reconstruction with inverse variances as weights,
//! cleaned of the noise that is left.

use super::common::generated::{self, Options};
use super::common::inputs::{Inputs, check_memory};
use super::{Context, EdgeTrust, Method, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Needs};
use crate::image::planes::Planes;

/// `feature`.
pub const METHOD: Method = Method {
    id: "feature",
    summary: "Poisson reconstruction weighted by variances, bagged and cleaned: what `apr` takes as a feature; consistent",
    traits: Traits { robust: false, edges: EdgeTrust::ByVariance, ..Traits::FILTER },
    parameters: &[generated::ROUNDS, generated::SCREEN, generated::VARIANCES, generated::PREFILTER, generated::AMBIENT],
    make,
};

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 950;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    Ok(Box::new(Feature { options: Options::new(parameters)? }))
}

struct Feature {
    options: Options,
}

impl Reconstruction for Feature {
    fn needs(&self) -> Needs {
        self.options.needs()
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let inputs = Inputs::new(frame, 1)?;
        check_memory(frame, context, METHOD.id, BYTES)?;
        let report = |share| (context.progress)("feature", share);
        let [feature, variance] = generated::feature(&inputs, &self.options, &report)?;
        let (width, height) = (frame.width, frame.height);
        let error = generated::error(&variance, &Planes::new(width, height, 1));
        Ok(Solution {
            image: feature.to_image(width, height, 1.0 / inputs.scale),
            alpha: None,
            error: Some(inputs.error(&error.map(|error| error / 3.0))),
            notes: Vec::new(),
        })
    }
}
