//! What an adaptive run has decided and learnt so far: all that it takes, besides the film, to go on with it.

use serde::{Deserialize, Serialize};

use super::estimate::Estimate;
use super::{PASSES, Pass};
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::reconstruct::Solution;

/// How far a run has come.
#[derive(Debug, Default)]
pub struct Journal {
    /// What fits into a few lines.
    pub notes: Notes,
    /// Samples that every pixel is to have after the pass that is being rendered; empty between passes.
    pub goals: Vec<u32>,
    /// What was known when the pass began, if there is something to be learnt from it.
    pub before: Option<Seen>,
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

/// Where in a run.
pub(super) enum Stage {
    /// In the first pass or before it.
    Fresh,
    /// In a later pass, whose goals are written down.
    Dealing,
    /// After a pass.
    Between,
}

/// An image and the samples it was made of.
#[derive(Debug)]
pub struct Seen {
    pub(super) frame: Frame,
    pub(super) solution: Solution,
}

/// Layers of an earlier frame that are asked for.
const SEEN: [Layer; 5] = [Layer::Samples, Layer::Color, Layer::ColorVariance, Layer::Direct, Layer::DirectVariance];

impl Seen {
    /// None without an estimated error, which is all there is to learn about.
    pub(super) fn new(frame: Frame, solution: Option<Solution>) -> Option<Self> {
        let solution = solution.filter(|solution| solution.error.is_some())?;
        Some(Self { frame, solution })
    }

    /// Its images, in an order that [`Seen::from_images`] knows.
    pub fn images(&self) -> Vec<&Image> {
        let layers = SEEN.iter().filter_map(|&layer| self.frame.get(layer));
        layers.chain([&self.solution.image]).chain(&self.solution.error).collect()
    }

    /// Channels of the images.
    pub fn channels() -> impl Iterator<Item = usize> {
        SEEN.iter().map(|layer| layer.info().channels.len()).chain([3, 3])
    }

    /// None if these are not as many images as there have to be.
    pub fn from_images(images: Vec<Image>) -> Option<Self> {
        let mut images = images.into_iter();
        let first = images.next()?;
        let mut frame = Frame::new(first.width, first.height);
        frame.set(SEEN[0], first);
        SEEN[1..].iter().try_for_each(|&layer| images.next().map(|image| frame.set(layer, image)))?;
        let (image, error) = (images.next()?, images.next());
        Some(Self { frame, solution: Solution { image, error, notes: Vec::new() } })
    }
}

impl Journal {
    pub(super) fn stage(&self) -> Stage {
        match () {
            () if !self.goals.is_empty() => Stage::Dealing,
            () if self.notes.passes.is_empty() => Stage::Fresh,
            () => Stage::Between,
        }
    }

    /// Ends a pass, after which there is this frame.
    pub(super) fn learn(&mut self, after: &Frame) {
        if let Some(Seen { frame, solution }) = self.before.take() {
            self.notes.estimate.learn(&frame, &solution, after);
        }
        self.goals.clear();
    }
}
