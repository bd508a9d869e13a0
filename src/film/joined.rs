//! Both ends of the edges between chosen neighbours joined.

use rayon::prelude::*;

use super::statistics::Record;
use super::{BINS, Edges, Film, Neighbours, STEPS, Tile, opposite};
use crate::math::{Rgb, vec3};

/// An end of an edge that was sampled: its half-edge, and the weight of its "neighbour minus pixel" in "higher minus lower".
struct End<'a> {
    tile: &'a Tile,
    /// Pixel and half-edge of the pixel.
    pixel: usize,
    slot: usize,
    weight: f32,
}

impl Film {
    /// The edges between chosen neighbours, as far as they were sampled: half of an edge is no estimate, unless the kernel is
    /// directed.
    pub(super) fn joined(&self, neighbours: &Neighbours) -> Edges {
        let size = neighbours.size();
        let sampled = neighbours.pairs().filter(|ends| self.ends(neighbours, *ends).iter().any(Option::is_some));
        let mut edges = Edges::new(size, sampled);
        let all = 0..edges.len();
        let ends = |edge: usize| self.ends(neighbours, edges.ends(edge)).into_iter().flatten();
        let mean = all.clone().into_par_iter().map(|edge| ends(edge).map(|end| end.mean()).sum()).collect();
        let variance = all.clone().into_par_iter().map(|edge| ends(edge).map(|end| end.variance()).sum()).collect();
        let binned = |record: Record| -> Vec<[Rgb; BINS]> {
            if !record.is_recorded(self.needs) {
                return Vec::new();
            }
            let of_edge = |edge| std::array::from_fn(|k| ends(edge).map(|end| end.bin(record, k)).sum());
            all.clone().into_par_iter().map(of_edge).collect()
        };
        let (bins, ambient) = (binned(Record::EdgeBins), binned(Record::AmbientEdgeBins));
        let least = |edge| ends(edge).map(|end| end.count()).min().unwrap_or(0);
        let counts = all.clone().map(least).collect();
        (edges.mean, edges.variance, edges.bins, edges.ambient, edges.counts) = (mean, variance, bins, ambient, counts);
        edges.weights = weights(neighbours, &edges);
        edges
    }

    /// The ends that the estimate of an edge is made of: none if it has not been sampled well enough.
    fn ends(&self, neighbours: &Neighbours, [a, b]: [usize; 2]) -> [Option<End<'_>>; 2] {
        let (lower, higher) = (a.min(b), a.max(b));
        let (width, _) = neighbours.size();
        let Some(step) = step_between(width, lower, higher) else { return [None, None] };
        let end = |pixel: usize, step: usize, weight: f32| {
            let slot = neighbours.slot(pixel, step)?;
            let (tile, pixel) = self.at(pixel % width, pixel / width);
            (tile.edge_count(pixel) > 0).then_some(End { tile, pixel, slot, weight })
        };
        let mut ends = [end(lower, step, 1.0), end(higher, opposite(step), -1.0)];
        if neighbours.is_directed() {
            // Either end holds half of an estimate of its own.
            let total: u32 = ends.iter().flatten().map(End::count).sum();
            ends.iter_mut().flatten().for_each(|end| end.weight *= 2.0 * end.count() as f32 / total as f32);
        } else if ends.iter().any(Option::is_none) {
            return [None, None];
        }
        ends
    }
}

/// Position in [`STEPS`] of the step from a pixel to another one of images of some width.
fn step_between(width: usize, from: usize, to: usize) -> Option<usize> {
    let across = |of: fn(usize, usize) -> usize| of(to, width) as i32 - of(from, width) as i32;
    let offset = (across(|pixel, width| pixel % width), across(|pixel, width| pixel / width));
    STEPS.iter().position(|step| *step == offset)
}

/// Weights of the neighbour at either end of all edges; none if neighbours come without weights.
fn weights(neighbours: &Neighbours, edges: &Edges) -> Vec<[f32; 2]> {
    if neighbours.weights().is_empty() {
        return Vec::new();
    }
    let of_edge = |edge: usize| {
        let [lower, higher] = edges.ends(edge);
        let at = |pixel: usize, step: usize| neighbours.weights()[pixel][step].to_f32();
        let step = step_between(neighbours.size().0, lower, higher);
        step.map_or([1.0; 2], |step| [at(lower, step), at(higher, opposite(step))])
    };
    (0..edges.len()).into_par_iter().map(of_edge).collect()
}

impl End<'_> {
    fn count(&self) -> u32 {
        self.tile.edge_count(self.pixel)
    }

    fn mean(&self) -> Rgb {
        self.weight * self.tile.values(Record::Edges, self.pixel).map_or(Rgb::ZERO, |values| color(values, self.slot))
    }

    fn variance(&self) -> Rgb {
        let of_channel = |c: usize| self.tile.variance(Record::Edges, self.pixel, 3 * self.slot + c);
        self.weight * self.weight * vec3(of_channel(0), of_channel(1), of_channel(2))
    }

    fn bin(&self, record: Record, k: usize) -> Rgb {
        self.weight * color(self.tile.bin(record, self.pixel, k), self.slot)
    }
}

fn color(values: &[f32], slot: usize) -> Rgb {
    vec3(values[3 * slot], values[3 * slot + 1], values[3 * slot + 2])
}
