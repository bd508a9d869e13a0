//! Rendering: paths into a film, wave by wave.

pub mod gradient;
pub mod path;
mod sampler;
mod schedule;

pub use self::sampler::Sampler;
pub use self::schedule::{Budget, Control, Outcome, Settings, add, render};
use crate::film::Sample;
use crate::math::{Vec2, vec2};
use crate::scene::{Ray, Scene};

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

/// What a camera ray is chosen by.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Position on the film, in pixels.
    pub film: Vec2,
    /// Position on the lens, in the unit square.
    pub lens: Vec2,
}

impl View {
    /// The same view from a neighbouring pixel.
    pub fn moved(self, (dx, dy): (i32, i32)) -> Self {
        Self { film: self.film + vec2(dx as f32, dy as f32), ..self }
    }

    fn ray(self, scene: &Scene) -> Ray {
        scene.sensor().ray(self.film, self.lens)
    }
}

/// Renders a single sample: the base path alone, or with its differences to the four neighbours.
pub fn sample(scene: &Scene, id: SampleId, occlusion: bool, gradient: Option<&mut gradient::Tracer>) -> Sample {
    let sampler = Sampler::new(id, scene.sensor().width);
    let [u, v, lens_u, lens_v] = sampler.camera();
    let view = View { film: vec2(id.x as f32 + u, id.y as f32 + v), lens: vec2(lens_u, lens_v) };
    let mut sample = match gradient {
        None => path::trace(scene, &sampler, view, &mut ()),
        Some(tracer) => tracer.sample(scene, &sampler, view, id),
    };
    if occlusion {
        sample.features.occlusion = path::occlusion(scene, &sample.features, sampler.occlusion());
    }
    sample
}
