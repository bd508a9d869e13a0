//! Connections between a running render and its caller.

use std::sync::atomic::AtomicBool;

use super::outcome::RenderOutcome;
use super::wave::Samples;
use crate::math::Vec2;

/// Receives the film of a render from time to time: writes checkpoints, or shows it.
pub trait FilmSink: Sync {
    /// Whether it wants the film now; called between tiles.
    fn due(&self) -> bool;

    /// Takes the film; called while no tile is being rendered, and at the end of the render.
    fn put(&self, outcome: &RenderOutcome);
}

/// One sample of each of some pixels.
pub struct WaveSamples<'a> {
    /// Number of the samples, from 0 on.
    pub number: u32,
    /// Position within the pixels, in [0, 1)².
    pub film: Vec2,
    /// The pixels, row by row.
    pub pixels: &'a [(usize, usize)],
    /// Their samples.
    pub samples: &'a Samples<'a>,
}

/// Receives the samples of a render one by one.
pub trait SampleSink: Sync {
    /// Takes samples; called by all threads.
    fn put(&self, wave: &WaveSamples);
}

/// Connections between the caller and a running render.
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Set by the caller to end the render after the tiles that are being rendered.
    pub stop: &'a AtomicBool,
    /// Called with the finished share, in [0, 1].
    pub progress: &'a (dyn Fn(f32) + Sync),
    /// Receivers of the film.
    pub sinks: &'a [&'a dyn FilmSink],
    /// Receiver of single samples.
    pub samples: Option<&'a dyn SampleSink>,
}

/// The flag of renders that are never stopped; nobody sets it.
static NEVER: AtomicBool = AtomicBool::new(false);

impl Control<'_> {
    /// Hands a film whose render has ended to all receivers.
    pub fn conclude(&self, outcome: &RenderOutcome) {
        self.sinks.iter().for_each(|sink| sink.put(outcome));
    }

    /// Never stops, and reports to nobody.
    pub const QUIET: Self = Self { stop: &NEVER, progress: &|_| {}, sinks: &[], samples: None };
}
