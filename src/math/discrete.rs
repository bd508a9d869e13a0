//! Sampling an index, or a point of a grid, in proportion to given weights.

use super::{Vec2, vec2};

/// A distribution over indices by inversion of its cumulative sum, which keeps numbers that are close together on indices
/// that are. Sums are 32-bit shares of the total: indices of less than that are never drawn, and their probability says so.
#[derive(Clone, Debug)]
pub struct Discrete {
    /// Running sums, starting with 0 and ending with the total.
    cumulative: Vec<u32>,
    /// The index that the start of each of some equal parts of the total falls on, so that searches are short.
    guide: Vec<u32>,
    total: f64,
}

/// Indices a part of the guide, on average.
const PART: usize = 8;

impl Discrete {
    /// Weights must be finite and not negative. `None` when they sum to zero.
    pub fn new(weights: impl IntoIterator<Item = f32> + Clone) -> Option<Self> {
        let total: f64 = weights.clone().into_iter().map(f64::from).sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut cumulative = vec![0];
        let mut sum = 0.0;
        for weight in weights {
            sum += f64::from(weight);
            cumulative.push((sum / total * f64::from(u32::MAX)) as u32);
        }
        let n = cumulative.len() - 1;
        cumulative[n] = u32::MAX;
        let parts = n.div_ceil(PART);
        let start = |part: usize| {
            let target = (part as f64 / parts as f64 * f64::from(u32::MAX)) as u32;
            cumulative.partition_point(|&sum| sum <= target).saturating_sub(1).min(n - 1) as u32
        };
        let guide = (0..parts).map(start).collect();
        Some(Self { cumulative, guide, total })
    }

    /// Sum of all weights.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// The index that `u` in [0, 1) falls on, and `u` stretched to [0, 1) within it for further use.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        // 2^-32 of the total is missing at the end.
        let target = (f64::from(u) * f64::from(u32::MAX)) as u32;
        let last = self.cumulative.len() - 2;
        let part = ((u * self.guide.len() as f32) as usize).min(self.guide.len() - 1);
        let mut index = self.guide[part] as usize;
        while index < last && self.cumulative[index + 1] <= target {
            index += 1;
        }
        // Parts are found in floats, which may round up; and an entry without weight may stand beside the one meant.
        while index > 0 && (self.cumulative[index] > target || self.cumulative[index + 1] == self.cumulative[index]) {
            index -= 1;
        }
        let (low, high) = (self.cumulative[index], self.cumulative[index + 1]);
        let rest = if high > low { (target.saturating_sub(low)) as f32 / (high - low) as f32 } else { 0.0 };
        (index, rest.clamp(0.0, 1.0 - f32::EPSILON / 2.0))
    }

    /// Probability of `index`.
    #[inline]
    pub fn probability(&self, index: usize) -> f32 {
        (self.cumulative[index + 1] - self.cumulative[index]) as f32 * (1.0 / u32::MAX as f32)
    }
}

/// A piecewise-constant density over the unit square, sampled row first.
#[derive(Clone, Debug)]
pub struct Grid {
    rows: Discrete,
    columns: Vec<Option<Discrete>>,
    width: usize,
}

impl Grid {
    /// Weights of `width` cells a row, row by row. `None` when all are zero.
    pub fn new(weights: &[f32], width: usize) -> Option<Self> {
        let columns: Vec<_> = weights.chunks_exact(width).map(|row| Discrete::new(row.iter().copied())).collect();
        let rows = Discrete::new(columns.iter().map(|row| row.as_ref().map_or(0.0, |row| row.total() as f32)))?;
        Some(Self { rows, columns, width })
    }

    /// A point of the unit square and its density.
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let (row, v) = self.rows.sample(u.y);
        let Some(columns) = &self.columns[row] else { return (Vec2::ZERO, 0.0) };
        let (column, h) = columns.sample(u.x);
        let point = vec2((column as f32 + h) / self.width as f32, (row as f32 + v) / self.columns.len() as f32);
        (point, self.cell_pdf(row, column))
    }

    /// Density at a point.
    pub fn pdf(&self, point: Vec2) -> f32 {
        let cell = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        self.cell_pdf(cell(point.y, self.columns.len()), cell(point.x, self.width))
    }

    fn cell_pdf(&self, row: usize, column: usize) -> f32 {
        let cells = (self.width * self.columns.len()) as f32;
        let conditional = self.columns[row].as_ref().map_or(0.0, |columns| columns.probability(column));
        self.rows.probability(row) * conditional * cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_the_weights_and_empty_entries_are_never_drawn() {
        let table = Discrete::new([1.0, 0.0, 3.0, 0.0]).unwrap();
        let n = 4000;
        let mut counts = [0; 4];
        for i in 0..n {
            counts[table.sample(i as f32 / n as f32).0] += 1;
        }
        assert_eq!(counts, [1000, 0, 3000, 0]);
        assert_eq!(table.sample(1.0).0, 2);
        assert_eq!((table.probability(2), table.probability(3)), (0.75, 0.0));
        assert!(Discrete::new([0.0, 0.0]).is_none());
    }

    #[test]
    fn grid_density_integrates_to_one_and_agrees_with_its_samples() {
        let grid = Grid::new(&[1.0, 2.0, 0.0, 0.0, 0.0, 5.0], 3).unwrap();
        let mean =
            (0..6).map(|i| grid.pdf(vec2((i % 3) as f32 / 3.0 + 0.1, (i / 3) as f32 / 2.0 + 0.1))).sum::<f32>() / 6.0;
        assert!((mean - 1.0).abs() < 1e-6);
        for i in 0..100 {
            let (point, pdf) = grid.sample(vec2((i as f32 * 0.37) % 1.0, (i as f32 * 0.73) % 1.0));
            assert!(pdf > 0.0 && (grid.pdf(point) - pdf).abs() < 1e-5);
        }
    }
}
