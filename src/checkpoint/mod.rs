//! Checkpoints: an unfinished film with everything that is needed to resume it, bit for bit, or to add it to others.

mod file;
mod origin;

use std::sync::Mutex;

pub use self::file::{is_one, load, save};
pub use self::origin::{Origin, Run, content};
use crate::adaptive::{self, Journal};
use crate::film::Frame;
use crate::render::RenderOutcome;

/// A film and where it comes from.
pub struct Checkpoint {
    /// Scene, settings and sample numbers.
    pub origin: Origin,
    /// The film, its time and its first rejected sample.
    pub outcome: RenderOutcome,
    /// Decisions of an adaptive run.
    pub journal: Option<Journal>,
}

impl Checkpoint {
    /// The render so far, to be resumed.
    pub fn resume(self, journal: &Mutex<Journal>) -> adaptive::Start<'_> {
        *journal.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = self.journal.unwrap_or_default();
        adaptive::Start { render: self.outcome, journal }
    }

    /// The film's means and variances.
    pub fn develop(&self) -> Frame {
        self.outcome.film.develop().with_provenance(self.origin.provenance(&self.outcome))
    }

    /// Adds the samples of another checkpoint, as if they had been taken after those here. The error is the reason why
    /// they do not belong together. Sums in single precision depend on their order: callers sort films by their runs, so
    /// that the order of arguments changes no bit.
    pub fn merge(&mut self, other: Self) -> Result<(), String> {
        self.origin.adds_to(&other.origin)?;
        if self.outcome.film.kernel() != other.outcome.film.kernel() {
            return Err(
                "has chosen other neighbours by its own pilot: films that are to be merged take a --kernel without \
                        a pilot"
                    .into(),
            );
        }
        self.outcome.film.merge(&other.outcome.film);
        self.outcome.elapsed += other.outcome.elapsed;
        self.outcome.first_rejected = self.outcome.first_rejected.or(other.outcome.first_rejected);
        self.outcome.spp = self.outcome.film.fewest_samples();
        self.origin.runs.extend(other.origin.runs);
        // Decisions were made for each of them alone.
        self.journal = None;
        Ok(())
    }
}
