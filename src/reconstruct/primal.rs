//! The mean of the samples: plain path tracing.

use super::{Context, Method, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs};
use crate::image::planes::Planes;

/// `primal`.
pub const METHOD: Method = Method {
    id: "primal",
    summary: "the mean of the samples, as path tracing gives it",
    traits: Traits { denoises: false, keeps_mean: true, robust: false, ..Traits::FILTER },
    parameters: &[],
    make: |_| Ok(Box::new(Primal)),
};

struct Primal;

impl Reconstruction for Primal {
    fn needs(&self) -> Needs {
        Needs::default()
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn filter(&self, _frame: &Frame, shares: &Planes) -> Result<Option<Planes>> {
        Ok(Some(shares.clone()))
    }

    fn reconstruct(&self, frame: &Frame, _context: &Context) -> Result<Solution> {
        let image = frame.require(Layer::Color)?.clone();
        Ok(Solution { image, alpha: None, error: frame.get(Layer::ColorVariance).cloned(), notes: Vec::new() })
    }
}
