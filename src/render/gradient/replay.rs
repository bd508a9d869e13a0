//! Random replay: the neighbour's path of the same random numbers, camera and lens included. It maps the cube of random
//! numbers to itself, so that the Jacobian is one and either end of an edge counts half. It never fails, and is noisier and
//! slower than reconnection.

use super::{ShiftKind, ShiftMapping};
use crate::film::CROSS;
use crate::math::vec2;
use crate::render::camera::CameraSamples;
use crate::render::record::PathRecord;
use crate::render::tracer::PathTracer;

/// `replay`.
pub const SHIFT: ShiftKind = ShiftKind {
    id: "replay",
    summary: "trace the neighbour's path of the same random numbers; noisier, slower, never fails",
    make: |_, _| Box::new(Replay::default()),
};

#[derive(Default)]
struct Replay {
    neighbours: PathRecord,
}

impl ShiftMapping for Replay {
    fn needs_vertices(&self) -> bool {
        false
    }

    fn shift(&mut self, tracer: &mut PathTracer, camera: &CameraSamples, record: &mut PathRecord) {
        for (direction, step) in CROSS.into_iter().enumerate() {
            tracer.trace(camera, vec2(step.0 as f32, step.1 as f32), false, &mut self.neighbours);
            record.work.offsets += self.neighbours.work.paths;
            let samples = record.samples.iter_mut().zip(&self.neighbours.samples).zip(camera.pixels);
            for ((sample, neighbour), &pixel) in samples {
                let Some(differences) = &mut sample.differences else { continue };
                if camera.neighbour(pixel, step).is_some() {
                    differences.color[direction] = 0.5 * (neighbour.color - sample.color);
                    differences.ambient[direction] = 0.5 * (neighbour.ambient - sample.ambient);
                }
            }
        }
    }
}
