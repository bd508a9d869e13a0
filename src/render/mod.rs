//! Rendering: waves of paths into a film.
//!
//! ```text
//! schedule (tiles, rounds) -> wave -+- tracer: camera, direct, emission, continuation -> record
//!                                   +- gradient: shift mappings -> differences of the record's samples
//!                                   +- seen: emitters at the ends of camera rays -> their light in the samples
//!                                   +- thinning: which samples come with differences
//! ```

mod camera;
mod continuation;
mod control;
mod costs;
mod direct;
mod emission;
mod features;
pub mod gradient;
mod group_lights;
mod half_edges;
mod outcome;
mod paths;
mod per_tile;
mod record;
mod sampler;
mod schedule;
mod seen;
mod shown;
mod thinning;
mod tracer;
mod vertices;
mod wave;

use serde::{Deserialize, Serialize};

pub use self::control::{Control, FilmSink, SampleSink, WaveSamples};
pub use self::costs::sample_costs;
pub use self::gradient::{SHIFTS, Shift};
pub use self::outcome::RenderOutcome;
pub use self::sampler::Sampler;
pub use self::schedule::{Budget, RenderSettings, render, render_to_counts, resume, resume_to_counts, sample};
pub use self::shown::{Shown, ShownShapes, shown_shapes};
pub use self::wave::Samples;

/// Number of the samples: raised whenever a change of the program changes any bit of any sample, or a decision of adaptive runs. Films of different epochs are not
/// of the same samples, so they cannot be resumed or added.
pub const EPOCH: u32 = 4;

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
