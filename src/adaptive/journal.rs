//! The state of an adaptive run: everything that is needed, besides the film, to resume it.

use serde::{Deserialize, Serialize};

use super::Pass;
use super::budget::PASSES;
use super::estimate::Estimate;
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::reconstruct::Solution;

/// Decisions of a run so far.
#[derive(Debug, Default)]
pub struct Journal {
    /// Everything that is no image.
    pub notes: Notes,
    /// Sample count of every pixel after the current pass; empty between passes.
    pub goals: Vec<u32>,
    /// Image and samples before the current pass, if its samples can test the image's error estimate.
    pub previous: Option<PreviousPass>,
}

/// The part of a [`Journal`] that is no image.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Notes {
    /// Passes that have ended.
    pub passes: Vec<Pass>,
    /// Passes that are left, unless there is an error to reach.
    pub(super) left: u32,
    pub(super) estimate: Estimate,
}

impl Default for Notes {
    fn default() -> Self {
        Self { passes: Vec::new(), left: PASSES, estimate: Estimate::default() }
    }
}

/// Position in a run.
pub(super) enum Stage {
    /// In the first pass or before it.
    FirstPass,
    /// In a later pass, whose goals are written down.
    InPass,
    /// After a pass.
    BetweenPasses,
}

/// The image after a pass, and the samples it was made from.
#[derive(Debug)]
pub struct PreviousPass {
    pub(super) frame: Frame,
    pub(super) solution: Solution,
}

/// Layers that are kept of the frame.
const LAYERS: [Layer; 5] = [Layer::Samples, Layer::Color, Layer::ColorVariance, Layer::Direct, Layer::DirectVariance];

impl PreviousPass {
    /// None without an estimated error, which new samples are to test.
    pub(super) fn new(frame: Frame, solution: Option<Solution>) -> Option<Self> {
        let solution = solution.filter(|solution| solution.error.is_some())?;
        Some(Self { frame, solution })
    }

    /// Its images, in an order that [`PreviousPass::from_images`] knows.
    pub fn images(&self) -> Vec<&Image> {
        let layers = LAYERS.iter().filter_map(|&layer| self.frame.get(layer));
        layers.chain([&self.solution.image]).chain(&self.solution.error).collect()
    }

    /// Channels of the images.
    pub fn channels() -> impl Iterator<Item = usize> {
        LAYERS.iter().map(|layer| layer.info().channels.len()).chain([3, 3])
    }

    /// Reads the images back; none if there are too few.
    pub fn from_images(images: Vec<Image>) -> Option<Self> {
        let mut images = images.into_iter();
        let first = images.next()?;
        let mut frame = Frame::new(first.width, first.height);
        frame.set(LAYERS[0], first);
        LAYERS[1..].iter().try_for_each(|&layer| images.next().map(|image| frame.set(layer, image)))?;
        let (image, error) = (images.next()?, images.next());
        Some(Self { frame, solution: Solution { image, alpha: None, error, notes: Vec::new() } })
    }
}

impl Journal {
    pub(super) fn stage(&self) -> Stage {
        match () {
            () if !self.goals.is_empty() => Stage::InPass,
            () if self.notes.passes.is_empty() => Stage::FirstPass,
            () => Stage::BetweenPasses,
        }
    }

    /// Ends a pass, with the frame after it.
    pub(super) fn learn(&mut self, after: &Frame) {
        if let Some(PreviousPass { frame, solution }) = self.previous.take() {
            self.notes.estimate.learn(&frame, &solution, after);
        }
        self.goals.clear();
    }
}
