//! Checkpoints: a film in the making with all that it takes to go on with it, bit for bit, or to add it to others.

mod file;
mod origin;

use std::sync::Mutex;

pub use self::file::{is_one, load, save};
pub use self::origin::{Origin, Run, content};
use crate::adaptive::{self, Journal};
use crate::film::{Frame, Needs};
use crate::render::Outcome;

/// A film and where it comes from.
pub struct Checkpoint {
    /// What its samples were taken of, and which they are.
    pub origin: Origin,
    /// The film and how it went.
    pub outcome: Outcome,
    /// Decisions of an adaptive run.
    pub journal: Option<Journal>,
}

impl Checkpoint {
    /// The render so far, to be gone on with.
    pub fn begun(self, journal: &Mutex<Journal>) -> adaptive::Begun<'_> {
        *journal.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = self.journal.unwrap_or_default();
        adaptive::Begun { render: self.outcome, journal }
    }

    /// The film's means and variances. Differences that are known to be zero are there, too, if `needs` has some.
    pub fn develop(&self, needs: Needs) -> Frame {
        let mut frame = self.outcome.film.develop();
        if self.origin.dark && needs.edges && !self.origin.needs.edges {
            frame.fill_dark_edges();
        }
        frame.attributes = self.origin.attributes(&self.outcome);
        frame
    }

    /// Adds the samples of another, as if they had been taken after those here. Why not, if they are of another scene or
    /// some of them are here already. Sums in single precision depend on their order: sorted by their runs, films have the
    /// same sum whatever order they come in.
    pub fn merge(&mut self, other: Self) -> Result<(), String> {
        self.origin.adds_to(&other.origin)?;
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
