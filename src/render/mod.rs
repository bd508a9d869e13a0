//! Rendering: paths into a film, wave by wave.

pub mod gradient;
pub mod path;
mod sampler;
mod schedule;

pub use self::sampler::Sampler;
pub use self::schedule::{Budget, Control, Outcome, Settings, render};
use crate::film::Sample;
use crate::math::vec2;
use crate::scene::Scene;

/// One sample of one pixel, the same whenever and wherever it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// Renders a single sample: the base path alone, or with its differences to the four neighbours.
pub fn sample(scene: &Scene, id: SampleId, gradient: Option<&mut gradient::Tracer>) -> Sample {
    let sampler = Sampler::new(id, scene.sensor().width);
    let [u, v, ..] = sampler.camera();
    let film = vec2(id.x as f32 + u, id.y as f32 + v);
    match gradient {
        None => path::trace(scene, &sampler, film, &mut ()),
        Some(tracer) => tracer.sample(scene, &sampler, film, id),
    }
}
