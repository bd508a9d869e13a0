//! The same number of samples for every pixel.

use super::Allocator;
use crate::error::Result;
use crate::film::Frame;
use crate::reconstruct::Solution;

/// `uniform`.
pub struct Uniform;

impl Allocator for Uniform {
    fn id(&self) -> &'static str {
        "uniform"
    }

    fn summary(&self) -> &'static str {
        "the same number of samples for every pixel"
    }

    fn needs_error(&self) -> bool {
        false
    }

    fn need(&self, frame: &Frame, _: Option<&Solution>) -> Result<Vec<f32>> {
        Ok(vec![1.0; frame.width * frame.height])
    }
}
