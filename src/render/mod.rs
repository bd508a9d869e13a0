//! Rendering: waves of paths into a film.

mod features;
pub mod gradient;
mod path;
mod paths;
mod sampler;
mod schedule;
mod vertices;
mod wave;

use serde::{Deserialize, Serialize};

pub use self::sampler::Sampler;
pub use self::schedule::{Budget, Control, Keeper, Outcome, Settings, raise, render, resume, sample};

/// One sample of one pixel, the same whenever and wherever it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleId {
    /// The render's seed.
    pub seed: u64,
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Number of the sample within the pixel.
    pub index: u32,
}
