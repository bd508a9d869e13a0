//! Samples go where the sampled colours vary, for methods that do not estimate their error.

use super::Allocator;
use super::allocate::need;
use crate::error::Result;
use crate::film::{Frame, Layer};
use crate::reconstruct::Solution;

/// `variance`.
pub struct Variance;

impl Allocator for Variance {
    fn id(&self) -> &'static str {
        "variance"
    }

    fn summary(&self) -> &'static str {
        "by the relative standard deviation of the sampled colours; for every method"
    }

    fn needs_error(&self) -> bool {
        false
    }

    fn need(&self, frame: &Frame, _: Option<&Solution>) -> Result<Vec<f32>> {
        need(frame, frame.require(Layer::Color)?, frame.require(Layer::ColorVariance)?)
    }
}
