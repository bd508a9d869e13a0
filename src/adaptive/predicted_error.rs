//! Samples go where the reconstructed image is estimated to be wrong.

use super::Allocator;
use super::allocate::need;
use crate::error::{Error, Result};
use crate::film::Frame;
use crate::reconstruct::Solution;

/// `predicted_error`.
pub struct PredictedError;

impl Allocator for PredictedError {
    fn id(&self) -> &'static str {
        "predicted_error"
    }

    fn summary(&self) -> &'static str {
        "by the relative error that the method estimates for its image"
    }

    fn needs_error(&self) -> bool {
        true
    }

    fn need(&self, frame: &Frame, solution: Option<&Solution>) -> Result<Vec<f32>> {
        let missing = || Error::Usage("the method has not estimated its error".into());
        let solution = solution.ok_or_else(missing)?;
        need(frame, &solution.image, solution.error.as_ref().ok_or_else(missing)?)
    }
}
