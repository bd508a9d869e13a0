//! Random replay: the neighbour's path of the same random numbers, camera and lens included. It maps the cube of random
//! numbers to itself, so that the Jacobian is one and either end of an edge counts half. It never fails, so that one end
//! determines an edge, and is noisier and slower than reconnection.

use super::{ShiftKind, ShiftMapping};
use crate::render::camera::CameraSamples;
use crate::render::half_edges::HalfEdges;
use crate::render::record::PathRecord;
use crate::render::tracer::PathTracer;

/// `replay`.
pub const SHIFT: ShiftKind = ShiftKind {
    id: "replay",
    summary: "trace the neighbour's path of the same random numbers; noisier, slower, never fails",
    one_sided: true,
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

    fn shift(
        &mut self,
        tracer: &mut PathTracer,
        camera: &CameraSamples,
        record: &mut PathRecord,
        edges: &mut HalfEdges,
    ) {
        for slot in 0..edges.most() {
            // Paths that have so many half-edges, packed anew, and the steps across them.
            let shifted = (0..camera.pixels.len()).filter_map(|path| Some((path, edges.step(path, slot)?)));
            let (paths, steps): (Vec<_>, Vec<_>) = shifted.unzip();
            let pixels: Vec<_> = paths.iter().map(|&path| camera.pixels[path]).collect();
            let beside = CameraSamples { pixels: &pixels, ..*camera };
            tracer.trace_beside(&beside, &steps, &mut self.neighbours);
            record.work.offsets += self.neighbours.work.paths;
            for ((&path, &step), neighbour) in paths.iter().zip(&steps).zip(&self.neighbours.samples) {
                if camera.neighbour(camera.pixels[path], step).is_some() {
                    let sample = &record.samples[path];
                    let color = 0.5 * (neighbour.color - sample.color);
                    edges.add(path, slot, (color, Some(0.5 * (neighbour.ambient - sample.ambient))));
                }
            }
        }
    }
}
