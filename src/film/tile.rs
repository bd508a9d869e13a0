//! A square of the film: statistics of its pixels.

use super::statistic::{Ordinal, STATISTICS};
use super::{Needs, Rejected, Sample};

/// Statistics of a tile's pixels, row by row. A tile has one writer at a time, so there are no locks.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Left column in the film.
    pub x: usize,
    /// Top row in the film.
    pub y: usize,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Samples of every pixel.
    pub(super) counts: Vec<u32>,
    /// Samples of every pixel that came with differences; empty when edges are not recorded.
    pub(super) edge_counts: Vec<u32>,
    /// Samples of every pixel that were rejected; empty as long as there is none.
    pub(super) rejected: Vec<u32>,
    /// Values of every pixel, one plane for each row of [`STATISTICS`]; empty when it is not recorded, and when it is
    /// sparse and all zero.
    pub(super) planes: [Vec<f32>; STATISTICS.len()],
}

impl Tile {
    pub(super) fn new((x, y): (usize, usize), (width, height): (usize, usize), needs: Needs) -> Self {
        let pixels = width * height;
        let planes = STATISTICS.each_ref().map(|statistic| {
            let present = (statistic.recorded)(needs) && statistic.sparse.is_none();
            vec![0.0; if present { pixels * statistic.stride() } else { 0 }]
        });
        let edge_counts = vec![0; if needs.edges.is_sampled() { pixels } else { 0 }];
        Self { x, y, width, height, counts: vec![0; pixels], edge_counts, rejected: Vec::new(), planes }
    }

    /// Number of samples of pixel `index`, which is the number of its next sample.
    pub fn count(&self, index: usize) -> u32 {
        self.counts[index]
    }

    /// Number of samples of pixel `index` that came with differences.
    pub fn edge_count(&self, index: usize) -> u32 {
        self.edge_counts.get(index).copied().unwrap_or(0)
    }

    /// Samples of all pixels.
    pub fn samples(&self) -> u64 {
        self.counts.iter().map(|&count| u64::from(count)).sum()
    }

    /// Column and row in the film of pixel `index`.
    pub fn pixel(&self, index: usize) -> (usize, usize) {
        (self.x + index % self.width, self.y + index / self.width)
    }

    /// Number of samples of pixel `index` that a statistic was accumulated from.
    pub(super) fn count_of(&self, of_edges: bool, index: usize) -> u32 {
        if of_edges { self.edge_count(index) } else { self.count(index) }
    }

    /// Adds a sample to pixel `index`. A sample that is not finite is counted as zero, and reported.
    pub fn add(&mut self, index: usize, sample: &Sample) -> Result<(), Rejected> {
        let outcome = sample.check();
        if outcome.is_err() {
            self.rejected.resize(self.counts.len(), 0);
            self.rejected[index] += 1;
            self.accumulate(index, &sample.zeroed());
        } else {
            self.accumulate(index, sample);
        }
        outcome
    }

    fn accumulate(&mut self, index: usize, sample: &Sample) {
        let ordinals = [false, true].map(|of_edges| Ordinal::after(self.count_of(of_edges, index)));
        for (statistic, plane) in STATISTICS.iter().zip(&mut self.planes) {
            if plane.is_empty() {
                if !statistic.sparse.is_some_and(|nonzero| nonzero(sample)) {
                    continue;
                }
                plane.resize(self.counts.len() * statistic.stride(), 0.0);
            }
            if !statistic.of_edges || sample.differences.is_some() {
                statistic.add(plane, index, ordinals[usize::from(statistic.of_edges)], sample);
            }
        }
        self.counts[index] += 1;
        if let (Some(count), true) = (self.edge_counts.get_mut(index), sample.differences.is_some()) {
            *count += 1;
        }
    }

    /// Adds the samples of a tile at the same place as if they had been taken after those here.
    pub(super) fn merge(&mut self, other: &Self) {
        for (k, statistic) in STATISTICS.iter().enumerate() {
            let mut mine = std::mem::take(&mut self.planes[k]);
            // A sparse plane that only one of both has is zero in the other.
            let length = mine.len().max(other.planes[k].len());
            mine.resize(length, 0.0);
            let zeros = if other.planes[k].is_empty() { vec![0.0; length] } else { Vec::new() };
            let theirs = if other.planes[k].is_empty() { &zeros } else { &other.planes[k] };
            let pixels = mine.chunks_exact_mut(statistic.stride()).zip(theirs.chunks_exact(statistic.stride()));
            for (index, (mine, theirs)) in pixels.enumerate() {
                let [n, m] = [&*self, other].map(|tile| tile.count_of(statistic.of_edges, index));
                if m > 0 {
                    statistic.merge(mine, theirs, n, m);
                }
            }
            self.planes[k] = mine;
        }
        self.rejected.resize(self.rejected.len().max(other.rejected.len()), 0);
        let add = |mine: &mut Vec<u32>, theirs: &[u32]| mine.iter_mut().zip(theirs).for_each(|(a, b)| *a += b);
        add(&mut self.counts, &other.counts);
        add(&mut self.edge_counts, &other.edge_counts);
        add(&mut self.rejected, &other.rejected);
    }
}
