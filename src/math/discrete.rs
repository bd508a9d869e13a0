//! Sampling an index, or a point of a grid, in proportion to given weights, by inversion of the cumulative sum: numbers
//! that are close together give positions that are.

use super::lanes::{LANES, Mask};
use super::{Vec2, vec2};

/// Running sums as 32-bit shares of the total, starting with 0 and ending with all. Indices of less than that are never
/// drawn, and their probability says so.
fn running_sums(weights: &[f32], total: f64) -> impl Iterator<Item = u32> {
    let mut sum = 0.0;
    let last = weights.len() - 1;
    let inner = weights.iter().enumerate().map(move |(i, &weight)| {
        sum += f64::from(weight);
        if i == last { u32::MAX } else { (sum / total * f64::from(u32::MAX)) as u32 }
    });
    std::iter::once(0).chain(inner)
}

fn total(weights: &[f32]) -> f64 {
    weights.iter().map(|&weight| f64::from(weight)).sum()
}

/// Indices a part of the guide, on average.
const PART: usize = 8;

/// The indices that the starts of some equal parts of the total fall on, so that searches are short.
fn guide(sums: &[u32]) -> impl Iterator<Item = u32> {
    let parts = (sums.len() - 1).div_ceil(PART);
    (0..parts).map(move |part| {
        let target = (part as f64 / parts as f64 * f64::from(u32::MAX)) as u32;
        sums.partition_point(|&sum| sum <= target).saturating_sub(1).min(sums.len() - 2) as u32
    })
}

/// The part of a guide that a number falls on.
#[inline(always)]
fn part(guide: &[u32], u: f32) -> usize {
    ((u * guide.len() as f32) as usize).min(guide.len() - 1)
}

/// The index that `u` in [0, 1) falls on, and `u` stretched to [0, 1) within it. The search begins at `index`.
#[inline(always)]
fn search(sums: &[u32], mut index: usize, u: f32) -> (usize, f32) {
    let target = (f64::from(u) * f64::from(u32::MAX)) as u32;
    let last = sums.len() - 2;
    while index < last && sums[index + 1] <= target {
        index += 1;
    }
    // Positions are computed in floats, which may round up; and an entry without weight may stand beside the one meant.
    while index > 0 && (sums[index] > target || sums[index + 1] == sums[index]) {
        index -= 1;
    }
    let (low, high) = (sums[index], sums[index + 1]);
    let rest = if high > low { (target.saturating_sub(low)) as f32 / (high - low) as f32 } else { 0.0 };
    (index, rest.clamp(0.0, 1.0 - f32::EPSILON / 2.0))
}

/// A piecewise-constant density over the unit square, sampled row first.
#[derive(Clone, Debug)]
pub struct Grid {
    width: usize,
    height: usize,
    rows: Vec<u32>,
    row_guide: Vec<u32>,
    /// Row after row; those without weight are all zero.
    columns: Vec<u32>,
    column_guides: Vec<u32>,
}

impl Grid {
    /// Weights of `width` cells a row, row by row; finite and not negative. `None` when all are zero.
    pub fn new(weights: &[f32], width: usize) -> Option<Self> {
        let totals: Vec<f32> = weights.chunks_exact(width).map(|row| total(row) as f32).collect();
        let all = total(&totals);
        if !(all > 0.0 && all.is_finite()) {
            return None;
        }
        let rows: Vec<u32> = running_sums(&totals, all).collect();
        let (mut columns, mut column_guides) = (Vec::new(), Vec::new());
        for row in weights.chunks_exact(width) {
            let start = columns.len();
            match total(row) {
                sum if sum > 0.0 => columns.extend(running_sums(row, sum)),
                _ => columns.resize(start + width + 1, 0),
            }
            column_guides.extend(guide(&columns[start..]));
        }
        let row_guide = guide(&rows).collect();
        Some(Self { width, height: totals.len(), rows, row_guide, columns, column_guides })
    }

    /// A point of the unit square and its density.
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let [point, ..] = self.sample_packet([u.x; LANES], [u.y; LANES], Mask::first(1));
        point
    }

    /// [`Grid::sample`] for the active ones of sixteen numbers. Memory is what takes time: it is asked for all of them
    /// before any of it is looked at.
    #[inline]
    pub fn sample_packet(&self, u: [f32; LANES], v: [f32; LANES], active: Mask) -> [(Vec2, f32); LANES] {
        let mut rows = [(0, 0.0); LANES];
        let mut starts = [0; LANES];
        for lane in active.lanes() {
            rows[lane] = search(&self.rows, self.row_guide[part(&self.row_guide, v[lane])] as usize, v[lane]);
        }
        for lane in active.lanes() {
            let guide = self.row_guide_of(rows[lane].0);
            starts[lane] = guide[part(guide, u[lane])] as usize;
        }
        let touched = active.lanes().fold(0, |all, lane| all | self.sums(rows[lane].0)[starts[lane]]);
        std::hint::black_box(touched);
        let mut points = [(Vec2::ZERO, 0.0); LANES];
        for lane in active.lanes() {
            let (row, down) = rows[lane];
            let (column, right) = search(self.sums(row), starts[lane], u[lane]);
            let at = vec2((column as f32 + right) / self.width as f32, (row as f32 + down) / self.height as f32);
            points[lane] = (at, self.cell_pdf(row, column));
        }
        points
    }

    #[inline(always)]
    fn sums(&self, row: usize) -> &[u32] {
        &self.columns[row * (self.width + 1)..][..self.width + 1]
    }

    #[inline(always)]
    fn row_guide_of(&self, row: usize) -> &[u32] {
        let parts = self.width.div_ceil(PART);
        &self.column_guides[row * parts..][..parts]
    }

    /// Density at a point.
    pub fn pdf(&self, point: Vec2) -> f32 {
        let cell = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        self.cell_pdf(cell(point.y, self.height), cell(point.x, self.width))
    }

    #[inline(always)]
    fn cell_pdf(&self, row: usize, column: usize) -> f32 {
        let share = |sums: &[u32], index: usize| (sums[index + 1] - sums[index]) as f32 * (1.0 / u32::MAX as f32);
        share(&self.rows, row) * share(self.sums(row), column) * (self.width * self.height) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_drawn_by_their_weights_and_empty_ones_never() {
        let weights: Vec<f32> = (0..50).map(|i| if i % 3 == 0 { 0.0 } else { (i * i % 17) as f32 }).collect();
        let sums: Vec<u32> = running_sums(&weights, total(&weights)).collect();
        let starts: Vec<u32> = guide(&sums).collect();
        let n = 200_000;
        let mut counts = vec![0.0; weights.len()];
        for i in 0..=n {
            let u = i as f32 / n as f32;
            let (index, rest) = search(&sums, starts[part(&starts, u)] as usize, u);
            assert!((0.0..1.0).contains(&rest) && weights[index] > 0.0, "{u}");
            counts[index] += 1.0 / n as f64;
        }
        for (count, &weight) in counts.iter().zip(&weights) {
            assert!((count - f64::from(weight) / total(&weights)).abs() < 2e-5);
        }
    }

    #[test]
    fn grid_density_integrates_to_one_and_agrees_with_its_samples() {
        let grid = Grid::new(&[1.0, 2.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0], 3).unwrap();
        let cell = |i: usize| vec2((i % 3) as f32 / 3.0 + 0.1, (i / 3) as f32 / 3.0 + 0.1);
        let mean = (0..9).map(|i| grid.pdf(cell(i))).sum::<f32>() / 9.0;
        assert!((mean - 1.0).abs() < 1e-6);
        for i in 0..100 {
            let (point, pdf) = grid.sample(vec2((i as f32 * 0.37) % 1.0, (i as f32 * 0.73) % 1.0));
            assert!(pdf > 0.0 && (grid.pdf(point) - pdf).abs() < 1e-5);
        }
        assert!(Grid::new(&[0.0; 6], 3).is_none());
    }
}
