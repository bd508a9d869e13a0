//! A square of the film: statistics of its pixels.

use std::ops::Range;

use super::statistic::{Ordinal, Statistic};
use super::statistics::STATISTICS;
use super::{Differences, GroupLight, Kernel, Needs, Neighbours, Rejected, Sample, TILE, Taken};

/// The half-edges of the first pixel of a tile where every pixel has the four of the cross.
pub(super) const CROSS: Range<usize> = 0..4;

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
    /// Number of groups of emitters.
    lights: usize,
    /// Samples of every pixel.
    pub(super) counts: Vec<u32>,
    /// Samples of every pixel that came with differences; empty when edges are not recorded.
    pub(super) edge_counts: Vec<u32>,
    /// Samples of every pixel that were rejected; empty as long as there is none.
    pub(super) rejected: Vec<u32>,
    /// Number of half-edges before those of every pixel, and of all of them; empty where every pixel has the cross's four.
    pub(super) half_edges: Vec<u32>,
    /// Values of every pixel, one plane for each row of [`STATISTICS`]; empty when it is not recorded, and when it is
    /// sparse and all zero.
    pub(super) planes: [Vec<f32>; STATISTICS.len()],
}

impl Tile {
    pub(super) fn new((x, y): (usize, usize), (width, height): (usize, usize), needs: Needs) -> Self {
        let pixels = width * height;
        let edge_counts = vec![0; if needs.edges.is_sampled() { pixels } else { 0 }];
        let (counts, rejected, half_edges) = (vec![0; pixels], Vec::new(), Vec::new());
        let planes = [const { Vec::new() }; STATISTICS.len()];
        let lights = usize::from(needs.lights);
        let mut tile = Self { x, y, width, height, lights, counts, edge_counts, rejected, half_edges, planes };
        for (k, statistic) in STATISTICS.iter().enumerate() {
            if statistic.is_recorded(needs) && statistic.sparse.is_none() {
                tile.planes[k] = vec![0.0; tile.floats(statistic)];
            }
        }
        tile
    }

    /// All empty tiles of a film, one by one.
    pub fn all((width, height): (usize, usize), needs: Needs, kernel: &Kernel) -> impl Iterator<Item = Self> {
        let corners = (0..height).step_by(TILE).flat_map(move |y| (0..width).step_by(TILE).map(move |x| (x, y)));
        corners.map(move |(x, y)| {
            let mut tile = Self::new((x, y), (TILE.min(width - x), TILE.min(height - y)), needs);
            match kernel {
                Kernel::Cross => {}
                Kernel::Pending => tile.set_half_edges(needs, |_| 0),
                Kernel::Chosen(neighbours) => tile.set_neighbours(needs, neighbours),
            }
            tile
        })
    }

    /// Makes room for the half-edges of these neighbours, in place of those that there were.
    pub(super) fn set_neighbours(&mut self, needs: Needs, neighbours: &Neighbours) {
        let width = neighbours.size().0;
        self.set_half_edges(needs, |(x, y)| neighbours.degree(y * width + x));
    }

    /// Makes room for as many half-edges of every pixel as `degree` says.
    pub(super) fn set_half_edges(&mut self, needs: Needs, degree: impl Fn((usize, usize)) -> usize) {
        let mut total = 0;
        self.half_edges = vec![0];
        for index in 0..self.counts.len() {
            total += degree(self.pixel(index)) as u32;
            self.half_edges.push(total);
        }
        self.edge_counts.fill(0);
        for (k, statistic) in STATISTICS.iter().enumerate().filter(|(_, statistic)| statistic.of_edges) {
            self.planes[k] = vec![0.0; if statistic.is_recorded(needs) { self.floats(statistic) } else { 0 }];
        }
    }

    /// Floats of a statistic of all pixels.
    pub(super) fn floats(&self, statistic: &Statistic) -> usize {
        self.span(statistic, self.counts.len() - 1).end
    }

    /// The floats of a statistic of pixel `index`, in its plane.
    pub(super) fn span(&self, statistic: &Statistic, index: usize) -> Range<usize> {
        let half_edges = match self.half_edges.get(index..index + 2) {
            Some(starts) => starts[0] as usize..starts[1] as usize,
            None => CROSS.end * index..CROSS.end * (index + 1),
        };
        statistic.span(index, &half_edges, self.lights)
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

    /// Columns and rows in the film of all pixels.
    pub fn pixels(&self) -> Vec<(usize, usize)> {
        (0..self.width * self.height).map(|index| self.pixel(index)).collect()
    }

    /// Number of samples of pixel `index` that a statistic was accumulated from.
    pub(super) fn count_of(&self, of_edges: bool, index: usize) -> u32 {
        if of_edges { self.edge_count(index) } else { self.count(index) }
    }

    /// Adds a sample to pixel `index`, with its differences if the path was shifted: one that was not leaves the counts of edges
    /// alone. A sample that is not finite is counted as zero, and reported.
    pub fn add(&mut self, index: usize, taken: Taken) -> Result<(), Rejected> {
        let outcome = taken.check();
        if outcome.is_err() {
            self.rejected.resize(self.counts.len(), 0);
            self.rejected[index] += 1;
            let (differences, lights) =
                (taken.differences.map(Differences::zeroed), vec![GroupLight::default(); taken.lights.len()]);
            self.accumulate(index, Taken { sample: &Sample::default(), differences, lights: &lights });
        } else {
            self.accumulate(index, taken);
        }
        outcome
    }

    fn accumulate(&mut self, index: usize, taken: Taken) {
        let ordinals = [false, true].map(|of_edges| Ordinal::after(self.count_of(of_edges, index)));
        for (k, statistic) in STATISTICS.iter().enumerate() {
            if self.planes[k].is_empty() {
                if !statistic.sparse.is_some_and(|nonzero| nonzero(taken.sample)) {
                    continue;
                }
                self.planes[k] = vec![0.0; self.floats(statistic)];
            }
            if !statistic.of_edges || taken.differences.is_some() {
                let (span, ordinal) = (self.span(statistic, index), ordinals[usize::from(statistic.of_edges)]);
                statistic.add(&mut self.planes[k][span], ordinal, taken);
            }
        }
        self.counts[index] += 1;
        if let (Some(count), true) = (self.edge_counts.get_mut(index), taken.differences.is_some()) {
            *count += 1;
        }
    }

    /// Adds the samples of a tile at the same place as if they had been taken after those here.
    pub fn merge(&mut self, other: &Self) {
        for (k, statistic) in STATISTICS.iter().enumerate() {
            let mut mine = std::mem::take(&mut self.planes[k]);
            // A sparse plane that only one of both has is zero in the other.
            let length = mine.len().max(other.planes[k].len());
            mine.resize(length, 0.0);
            let zeros = if other.planes[k].is_empty() { vec![0.0; length] } else { Vec::new() };
            let theirs = if other.planes[k].is_empty() { &zeros } else { &other.planes[k] };
            if length > 0 {
                for index in 0..self.counts.len() {
                    let [n, m] = [&*self, other].map(|tile| tile.count_of(statistic.of_edges, index));
                    if m > 0 {
                        let span = self.span(statistic, index);
                        statistic.merge(&mut mine[span.clone()], &theirs[span], n, m);
                    }
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
