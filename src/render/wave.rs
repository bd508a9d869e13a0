//! A wave: the same sample of many pixels, traced together, with its differences to the neighbouring pixels.

use super::camera::CameraSamples;
use super::features;
use super::gradient::{Shift, ShiftMapping};
use super::half_edges::HalfEdges;
use super::record::PathRecord;
use super::seen;
use super::thinning::Work;
use super::tracer::PathTracer;
use crate::film::{CROSS, Differences, GroupLight, Needs, Neighbours, Recorded, Sample, Taken};
use crate::math::lanes::LANES;
use crate::math::vec2;
use crate::scene::Scene;
use crate::scene::packet::Surfaces;

/// Takes samples, wave after wave; keeps its memory between them.
pub struct Wave<'a> {
    tracer: PathTracer<'a>,
    shift: Option<Box<dyn ShiftMapping>>,
    neighbours: Option<&'a Neighbours>,
    /// Half-edges of the pixel of the film that has the most.
    slots: usize,
    record: PathRecord,
    half_edges: HalfEdges,
    occlusion: bool,
    surfaces: Surfaces,
}

/// The samples of a wave, in the order of its pixels.
pub struct Samples<'a> {
    /// The samples.
    pub all: &'a [Sample],
    /// Light of every group of emitters in every sample, sample by sample.
    lights: &'a [GroupLight],
    half_edges: Option<&'a HalfEdges>,
    slots: usize,
}

impl<'a> Samples<'a> {
    /// A sample with everything that came along.
    pub fn taken(&self, index: usize) -> Taken<'a> {
        let groups = self.lights.len() / self.all.len();
        let lights = &self.lights[groups * index..groups * (index + 1)];
        Taken { sample: &self.all[index], differences: self.differences(index), lights }
    }

    /// Half-edges of the pixel of the film that has the most, if paths were shifted.
    pub fn slots(&self) -> Option<usize> {
        self.half_edges.map(|_| self.slots)
    }

    /// The differences that a sample came with, if its path was shifted.
    pub fn differences(&self, index: usize) -> Option<Differences<'a>> {
        self.half_edges.map(|half_edges| half_edges.differences(index))
    }
}

impl<'a> Wave<'a> {
    /// Waves that compute what a film with these needs records, with differences to chosen neighbours or to those of the cross.
    pub fn new(scene: &'a Scene, needs: Needs, shift: Shift, neighbours: Option<&'a Neighbours>) -> Self {
        Self {
            tracer: PathTracer::new(scene, needs),
            shift: needs.edges.is_sampled().then(|| shift.mapping(needs.has(Recorded::Ambient))),
            neighbours,
            slots: neighbours.map_or(CROSS.count_ones() as usize, Neighbours::most),
            record: PathRecord::default(),
            half_edges: HalfEdges::default(),
            occlusion: needs.has(Recorded::Occlusion),
            surfaces: Surfaces::default(),
        }
    }

    /// The scene.
    pub fn scene(&self) -> &'a Scene {
        self.tracer.scene
    }

    /// Sample number `index` of some pixels, in their order, with or without `differences` if the film records them. `grids`: the
    /// number of cells along a pixel's side over which directly seen light is averaged, for every pixel; empty for single rays.
    pub fn trace(
        &mut self,
        (seed, index): (u64, u32),
        pixels: &[(usize, usize)],
        grids: &[u32],
        differences: bool,
    ) -> Samples<'_> {
        let camera = CameraSamples::new(self.tracer.scene, seed, index, pixels);
        let mut shift = self.shift.as_mut().filter(|_| differences);
        let keep_all = shift.as_ref().is_some_and(|shift| shift.needs_vertices());
        self.tracer.trace(&camera, keep_all, &mut self.record);
        let shifted = shift.is_some();
        if let Some(shift) = &mut shift {
            self.half_edges.start(&camera, self.neighbours);
            shift.shift(&mut self.tracer, &camera, &mut self.record, &mut self.half_edges);
        }
        if grids.iter().any(|&side| side > 1) {
            seen::refine(self.tracer.scene, &camera, grids, &mut self.record, &mut self.surfaces);
        }
        if self.occlusion {
            for (first, samples) in self.record.samples.chunks_mut(LANES).enumerate() {
                let [u, v] = camera.sampler.occlusion(camera.hashes(first * LANES));
                for (lane, sample) in samples.iter_mut().enumerate() {
                    let numbers = vec2(u.0[lane], v.0[lane]);
                    features::set_occlusion(sample, self.tracer.scene, numbers);
                }
            }
        }
        let PathRecord { samples, lights, .. } = &self.record;
        let half_edges = shifted.then_some(&self.half_edges);
        Samples { all: samples, lights: lights.all(), half_edges, slots: self.slots }
    }

    /// Work of sample number zero of all pixels of a tile, with differences if the film records them.
    pub fn first_work(&mut self, seed: u64, pixels: &[(usize, usize)]) -> Work {
        self.trace((seed, 0), pixels, &[], true);
        self.work()
    }

    /// Work of the latest wave.
    pub fn work(&self) -> Work {
        self.record.work
    }
}
