//! Checkpoints: an unfinished film with everything that is needed to resume it, bit for bit, or to add it to others.

mod file;
mod header;
mod merge;
mod origin;

use std::sync::Mutex;

pub use self::file::{load, save};
pub use self::header::is_one;
pub use self::merge::{Merged, develop, merge};
pub use self::origin::{Origin, Run, content};
use crate::adaptive::{self, Journal};
use crate::error::Result;
use crate::film::{Frame, Rejected};
use crate::render::{RenderOutcome, SampleId};
use crate::sync::lock;
use std::path::Path;

/// A film and where it comes from.
pub struct Checkpoint {
    /// Scene, settings and sample numbers.
    pub origin: Origin,
    /// The film, its time and its first rejected sample.
    pub outcome: RenderOutcome,
    /// Decisions of an adaptive run.
    pub journal: Option<Journal>,
}

/// The content of a checkpoint as far as its header says.
pub struct Summary {
    /// Scene, settings and sample numbers.
    pub origin: Origin,
    /// Seconds of rendering.
    pub seconds: f64,
    /// Whether it belongs to an adaptive run.
    pub adaptive: bool,
    /// The first sample that was not finite, and the reason.
    pub rejected: Option<(SampleId, Rejected)>,
}

/// Reads what a checkpoint holds, without its statistics.
pub fn summary(path: &Path) -> Result<Summary> {
    let header = header::Reader::open(path, 1 << 16)?.header;
    let (seconds, adaptive, rejected) = (header.seconds, header.adaptive.is_some(), header.rejected());
    Ok(Summary { origin: header.origin, seconds, adaptive, rejected })
}

/// Reads a checkpoint from end to end. The error says how it is damaged.
pub fn verify(path: &Path) -> Result<()> {
    header::Reader::open(path, 1 << 20)?.finish()
}

impl Checkpoint {
    /// The render so far, to be resumed.
    pub fn resume(self, journal: &Mutex<Journal>) -> adaptive::Start<'_> {
        *lock(journal) = self.journal.unwrap_or_default();
        adaptive::Start { render: self.outcome, journal }
    }

    /// The film's means and variances.
    pub fn develop(&self) -> Frame {
        self.outcome.film.develop().with_provenance(self.origin.provenance(&self.outcome))
    }
}
