//! The second round of an adaptive job: its samples are allocated by those of the first.

use super::description::Job;
use super::ranges::ranges;
use crate::adaptive::Goals;
use crate::checkpoint;
use crate::error::{Error, Result};
use crate::reconstruct::{self, Context};

/// Samples that an image's pixels are to have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Allocated {
    /// Name of the image.
    pub name: String,
    /// Fewest of a pixel.
    pub least: u32,
    /// Most of a pixel.
    pub most: u32,
}

impl Job {
    /// Allocates the samples of the second round of all images by those of the first, and divides them into chunks; nothing if that has been
    /// done before. The error says that there is no second round, or which chunks of the first are missing.
    pub fn allocate(&self) -> Result<Vec<Allocated>> {
        let Some(first) = &self.adaptive else {
            let what = "this job has one round, with nothing to allocate: plan two by --adaptive";
            return Err(Error::Usage(what.into()));
        };
        if self.allocated.is_some() {
            return Ok(Vec::new());
        }
        let (mut bounds, mut allocated) = (Vec::new(), Vec::new());
        for image in 0..self.images() {
            let (films, left) = self.films(self.first_round(image))?;
            if !left.is_empty() {
                let what = format!("chunks {} of {} are not complete", ranges(&left), self.name(image));
                return Err(Error::Usage(format!("{what}: run them first")));
            }
            let (frame, merged) = checkpoint::develop(&films, &self.goals(image))?;
            let method = reconstruct::parse(&merged.origin.method)?;
            let goals = Goals::new(&frame, self.spp, (method.as_ref(), first.allocator()?), &Context::QUIET)?;
            goals.save(&self.goals(image))?;
            bounds.push(goals.divide(first.spp, self.second_chunks()));
            let (least, most) = (goals.counts.iter().min().unwrap_or(&0), goals.counts.iter().max().unwrap_or(&0));
            allocated.push(Allocated { name: self.name(image), least: *least, most: *most });
        }
        self.save_allocation(&bounds)?;
        Ok(allocated)
    }
}
