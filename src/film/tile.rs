//! A square of the film: statistics of its pixels.

use super::statistic::{Ordinal, Record, STATISTICS};
use super::{Needs, Rejected, Sample};
use crate::math::{Rgb, luminance};

/// Cost of a camera ray, in path samples.
const CELL: f32 = 0.05;
/// Largest number of cells along a pixel's side.
const LARGEST_GRID: u32 = 4;
/// Standard deviation of a sample that is usual where light is scattered, over its mean.
const USUAL_DEVIATION: f32 = 0.5;

/// Mean of a luminance, and variance of a single sample of it.
struct Luminance {
    mean: f32,
    variance: f32,
}

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

    /// Whether the camera has seen an emitter anywhere in the tile.
    pub fn sees_emitters(&self) -> bool {
        !self.planes[Record::Direct as usize].is_empty()
    }

    /// Cells along the side of pixel `index` over which its next sample of directly seen light had best be averaged. With n
    /// cells of a cost c in path samples the error for the time, (V_d / n + V) (1 + n c) by the variances of directly seen
    /// light and of everything else, is least at n = √(V_d / (V c)). Pixels that see nothing else share their time with those
    /// that do, so that V is at least what is usual there.
    pub fn direct_grid(&self, index: usize) -> u32 {
        let count = self.count(index);
        if count == 0 {
            return 1;
        }
        let (direct, color) = (self.luminance(Record::Direct, index), self.luminance(Record::Color, index));
        let (x, y) = (index % self.width, index / self.width);
        let mut step = 0.0f32;
        for y in y.saturating_sub(1)..(y + 2).min(self.height) {
            for near in (x.saturating_sub(1)..(x + 2).min(self.width)).map(|x| y * self.width + x) {
                if self.count(near) > 0 {
                    step = step.max((self.luminance(Record::Direct, near).mean - direct.mean).abs());
                }
            }
        }
        // An edge between two pixels may pass through this one: a twentieth of its area on the other side, say.
        let variance = direct.variance.max(0.05 * step * step);
        let usual = USUAL_DEVIATION * (direct.mean + color.mean);
        let other = color.variance.max(usual * usual);
        let cells = (variance / (other * CELL).max(f32::MIN_POSITIVE)).sqrt();
        (cells.sqrt().round() as u32).clamp(1, LARGEST_GRID)
    }

    /// Luminance of a colour at a pixel, over its samples.
    fn luminance(&self, record: Record, index: usize) -> Luminance {
        let plane = &self.planes[record as usize];
        let Some(values) = plane.get(6 * index..6 * index + 6) else { return Luminance { mean: 0.0, variance: 0.0 } };
        let [mean, deviations] = [0, 3].map(|first| luminance(Rgb::from_slice(&values[first..first + 3])));
        Luminance { mean, variance: deviations / self.count(index).max(1) as f32 }
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
