//! Connections between a run and its caller.

use std::sync::atomic::AtomicBool;

use crate::render::{Control, FilmSink};

/// Stage of a run in which samples are taken, by its name in progress.
pub const RENDERING: &str = "rendering";

/// Whoever has a recipe carried out: a program, a module, a test.
#[derive(Clone, Copy)]
pub struct Host<'a> {
    /// Set by the host to end the rendering after the tiles that are under way. An image is made of the samples so far.
    pub stop: &'a AtomicBool,
    /// Called with the stage, [`RENDERING`] or one of the method's, and its finished share in [0, 1].
    pub progress: &'a (dyn Fn(&str, f32) + Sync),
    /// Called with warnings, sentences without an end.
    pub warn: &'a (dyn Fn(&str) + Sync),
    /// Receivers of the film.
    pub sinks: &'a [&'a dyn FilmSink],
}

impl Host<'_> {
    /// Never stops a run, and hears nothing.
    pub const QUIET: Self = Self { stop: Control::QUIET.stop, progress: &|_, _| {}, warn: &|_| {}, sinks: &[] };
}
