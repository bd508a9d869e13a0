//! Gradient-domain path tracing: see the README beside this file for the estimator.

mod base_path;
pub mod shift;

use self::base_path::BasePath;
use self::shift::{Shift, Walk};
use super::{SampleId, Sampler, View, path};
use crate::film::{EDGES, Sample};
use crate::scene::Scene;

/// Traces samples with their differences to the neighbours; keeps its buffers between samples.
pub struct Tracer {
    base: BasePath,
    shift: Shift,
    ambient: bool,
}

impl Tracer {
    /// Differences by a shift, also those that an ambient light would make if asked for.
    pub fn new(shift: Shift, ambient: bool) -> Self {
        Self { base: BasePath::default(), shift, ambient }
    }

    /// The path tracer's sample, bit for bit, with this pixel's end of each edge.
    pub fn sample(&mut self, scene: &Scene, sampler: &Sampler, view: View, id: SampleId) -> Sample {
        self.base.clear();
        let mut sample = path::trace(scene, sampler, view, &mut self.base);
        // The other ends of the edges account for what copies of a dark path would carry; replays are no copies.
        if self.shift != Shift::Replay && !self.ambient && self.base.is_dark() {
            return sample;
        }
        let size = (scene.sensor().width as i64, scene.sensor().height as i64);
        let (color, of_ambient) = (sample.color, sample.ambient.color);
        for ((edge, ambient), step) in sample.edges.iter_mut().zip(&mut sample.ambient.edges).zip(EDGES) {
            let (x, y) = (id.x as i64 + i64::from(step.0), id.y as i64 + i64::from(step.1));
            if x < 0 || y < 0 || x >= size.0 || y >= size.1 {
                continue;
            }
            let neighbour = view.moved(step);
            (*edge, *ambient) = match self.shift {
                Shift::Reconnect { threshold } => {
                    let walk = Walk::new(scene, threshold, self.ambient);
                    walk.along(&self.base, neighbour.ray(scene))
                }
                // Both ends sample every pair of paths of the same numbers: each counts half.
                Shift::Replay => {
                    let there = path::trace(scene, sampler, neighbour, &mut ());
                    (0.5 * (there.color - color), 0.5 * (there.ambient.color - of_ambient))
                }
            };
        }
        sample
    }
}
