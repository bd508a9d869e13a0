//! Gradient-domain path tracing: see the README beside this file for the estimator.

mod base_path;
pub mod shift;

use self::base_path::BasePath;
use self::shift::Shift;
use super::{SampleId, Sampler, View, path};
use crate::film::{EDGES, Sample};
use crate::scene::Scene;

/// Traces samples with their differences to the neighbours; keeps its buffers between samples.
pub struct Tracer {
    base: BasePath,
    shift: Shift,
}

impl Tracer {
    /// Smooth lobes of roughness above `threshold` are reconnected through.
    pub fn new(threshold: f32) -> Self {
        Self { base: BasePath::default(), shift: Shift { threshold } }
    }

    /// The path tracer's sample, bit for bit, with this pixel's end of each edge.
    pub fn sample(&mut self, scene: &Scene, sampler: &Sampler, view: View, id: SampleId) -> Sample {
        self.base.clear();
        let mut sample = path::trace(scene, sampler, view, &mut self.base);
        if self.base.is_dark() {
            return sample;
        }
        let size = (scene.sensor().width as i64, scene.sensor().height as i64);
        for (edge, (dx, dy)) in sample.edges.iter_mut().zip(EDGES) {
            let (x, y) = (id.x as i64 + i64::from(dx), id.y as i64 + i64::from(dy));
            if x >= 0 && y >= 0 && x < size.0 && y < size.1 {
                *edge = self.shift.difference(scene, &self.base, view.moved((dx, dy)).ray(scene));
            }
        }
        sample
    }
}
