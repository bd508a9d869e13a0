//! Sampling a point of an image in proportion to its brightness, by cells that are small where the image varies and few
//! enough for the cache. The image is cut into strips of rows and each strip into cells: one number chooses the strip and
//! the other the cell, so that numbers that cover the square evenly give points that cover the image as evenly.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::Range;

use super::lanes::{LANES, Mask};
use super::{Vec2, vec2};

/// Most strips of rows.
const STRIPS: usize = 128;

/// Most cells of all strips: with what finds them they take a third of a megabyte.
const CELLS: usize = 1 << 14;

/// Cells for each part of a guide, on average.
const PART: usize = 2;

/// Consecutive intervals and the share of each: of strips over the rows, or of cells over the columns of a strip.
#[derive(Clone, Debug)]
struct Cuts {
    /// First position of each interval, and the end of the last one.
    starts: Vec<u32>,
    /// Running sums of the weights as 32-bit shares of the total, from 0 to all.
    sums: Vec<u32>,
    /// The intervals that the starts of equal parts of the total fall on, so that searches are short.
    by_share: Vec<u32>,
    /// The intervals that the starts of equal parts of the positions fall on.
    by_place: Vec<u32>,
}

impl Cuts {
    /// Cuts between intervals that follow each other, with their weights.
    fn new(intervals: &[(Range<u32>, f64)]) -> Self {
        let mut starts: Vec<u32> = intervals.iter().map(|(range, _)| range.start).collect();
        let end = intervals.last().map_or(0, |(range, _)| range.end);
        starts.push(end);
        let total: f64 = intervals.iter().map(|(_, weight)| weight).sum();
        let (mut sums, mut sum) = (vec![0], 0.0);
        for (_, weight) in intervals {
            sum += weight;
            sums.push(if total > 0.0 { (sum / total * f64::from(u32::MAX)) as u32 } else { 0 });
        }
        if total > 0.0 {
            // The last sum is all there is, whatever rounding has made of it.
            sums[intervals.len()] = u32::MAX;
        }
        let parts = intervals.len().div_ceil(PART);
        let guide = |values: &[u32], most: u32| {
            let target = |part: usize| (part as f64 / parts as f64 * f64::from(most)) as u32;
            let interval = |part| values.partition_point(|&value| value <= target(part)).saturating_sub(1);
            (0..parts).map(|part| interval(part).min(intervals.len() - 1) as u32).collect()
        };
        Self { by_share: guide(&sums, u32::MAX), by_place: guide(&starts, end), starts, sums }
    }

    /// An interval and a position in it, drawn with `u` in [0, 1).
    #[inline(always)]
    fn sample(&self, u: f32) -> (usize, f32) {
        let sums = &self.sums;
        let target = (f64::from(u) * f64::from(u32::MAX)) as u32;
        let part = ((u * self.by_share.len() as f32) as usize).min(self.by_share.len() - 1);
        let (mut index, last) = (self.by_share[part] as usize, sums.len() - 2);
        while index < last && sums[index + 1] <= target {
            index += 1;
        }
        // The part is computed in floats, which may round up; and an interval without weight may stand beside the one meant.
        while index > 0 && (sums[index] > target || sums[index + 1] == sums[index]) {
            index -= 1;
        }
        let (low, high) = (sums[index], sums[index + 1]);
        let rest = if high > low { target.saturating_sub(low) as f32 / (high - low) as f32 } else { 0.0 };
        let (start, end) = (self.starts[index] as f32, self.starts[index + 1] as f32);
        // Rounding up would leave the interval.
        (index, (start + rest * (end - start)).min(end.next_down()))
    }

    /// The interval of a position.
    #[inline(always)]
    fn find(&self, place: u32) -> usize {
        let (starts, parts) = (&self.starts, self.by_place.len());
        let part = (place as usize * parts / starts[starts.len() - 1] as usize).min(parts - 1);
        let mut index = self.by_place[part] as usize;
        while starts[index + 1] <= place {
            index += 1;
        }
        index
    }

    /// Density inside an interval, per unit of length.
    #[inline(always)]
    fn density(&self, index: usize) -> f32 {
        let share = (self.sums[index + 1] - self.sums[index]) as f32 * (1.0 / u32::MAX as f32);
        share / (self.starts[index + 1] - self.starts[index]) as f32
    }
}

/// A piecewise-constant density over the unit square.
#[derive(Clone, Debug)]
pub struct Partition {
    size: Vec2,
    rows: Cuts,
    /// Cells of each strip.
    columns: Vec<Cuts>,
}

/// Sums over rectangles from the corner on, of weights and of their squares.
struct Sums {
    width: usize,
    sums: Vec<[f64; 2]>,
}

impl Sums {
    fn new(weights: &[f32], width: usize) -> Self {
        let mut sums = Vec::with_capacity((weights.len() / width + 1) * (width + 1));
        sums.resize(width + 1, [0.0; 2]);
        for row in weights.chunks_exact(width) {
            let above = sums.len() - width - 1;
            let mut running = [0.0; 2];
            sums.push(running);
            for (x, &weight) in row.iter().enumerate() {
                let weight = f64::from(weight);
                running = [running[0] + weight, running[1] + weight * weight];
                let before = sums[above + x + 1];
                sums.push([before[0] + running[0], before[1] + running[1]]);
            }
        }
        Self { width: width + 1, sums }
    }

    /// Weight of a rectangle as one cell, what makes the variance of a constant density inside of it least; and how much
    /// it exceeds the sum of what is in it.
    fn weight(&self, x: &Range<u32>, y: &Range<u32>) -> [f64; 2] {
        let at = |x: u32, y: u32| self.sums[y as usize * self.width + x as usize];
        let [all, top, left, both] = [at(x.end, y.end), at(x.end, y.start), at(x.start, y.end), at(x.start, y.start)];
        let [sum, squares] = [0, 1].map(|k: usize| (all[k] - top[k] - left[k] + both[k]).max(0.0));
        let area = f64::from(x.end - x.start) * f64::from(y.end - y.start);
        // Rounding must not make a cell less likely than what is in it.
        let weight = if sum > 0.0 { (area * squares).sqrt().max(sum) } else { 0.0 };
        [weight, weight - sum]
    }
}

/// An interval that may still be cut: rows of the image, or columns of a strip.
#[derive(Clone, Debug)]
struct Interval {
    strip: usize,
    range: Range<u32>,
    weight: f64,
    /// How much weight better cuts could save.
    excess: f64,
}

impl PartialEq for Interval {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Interval {}

impl PartialOrd for Interval {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Interval {
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |interval: &Self| (interval.strip, interval.range.start);
        self.excess.total_cmp(&other.excess).then(place(other).cmp(&place(self)))
    }
}

/// Halves whatever has the most excess until there are `most` intervals. They come in order.
fn cut(whole: Vec<Interval>, most: usize, weigh: impl Fn(usize, &Range<u32>) -> [f64; 2]) -> Vec<Interval> {
    let (mut open, mut done) = (BinaryHeap::from(whole), Vec::new());
    while let Some(Interval { strip, range, excess, .. }) = open.peek().cloned() {
        if excess <= 0.0 || open.len() + done.len() >= most {
            break;
        }
        let interval = open.pop();
        if range.len() == 1 {
            done.extend(interval);
            continue;
        }
        let middle = range.start.midpoint(range.end);
        for range in [range.start..middle, middle..range.end] {
            let [weight, excess] = weigh(strip, &range);
            open.push(Interval { strip, range, weight, excess });
        }
    }
    done.extend(open);
    done.sort_by_key(|interval| (interval.strip, interval.range.start));
    done
}

impl Partition {
    /// Weights of `width` pixels a row, row by row; finite and not negative. `None` when all are zero.
    pub fn new(weights: &[f32], width: usize) -> Option<Self> {
        let (columns, rows) = (0..width as u32, 0..(weights.len() / width) as u32);
        let sums = Sums::new(weights, width);
        // Strips are cut for what their columns vary downwards.
        let weigh = |_: usize, rows: &Range<u32>| {
            columns.clone().map(|x| sums.weight(&(x..x + 1), rows)).fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
        };
        let [weight, excess] = weigh(0, &rows);
        if !(weight > 0.0 && weight.is_finite()) {
            return None;
        }
        let strips = cut(vec![Interval { strip: 0, range: rows.clone(), weight, excess }], STRIPS, weigh);
        let weigh = |strip: usize, columns: &Range<u32>| sums.weight(columns, &strips[strip].range);
        let whole = |strip| {
            let [weight, excess] = weigh(strip, &columns);
            Interval { strip, range: columns.clone(), weight, excess }
        };
        let cells = cut((0..strips.len()).map(whole).collect(), CELLS, weigh);
        let (mut cuts, mut totals) = (Vec::new(), Vec::new());
        for (strip, cells) in strips.iter().zip(cells.chunk_by(|a, b| a.strip == b.strip)) {
            let cells: Vec<_> = cells.iter().map(|cell| (cell.range.clone(), cell.weight)).collect();
            totals.push((strip.range.clone(), cells.iter().map(|(_, weight)| weight).sum()));
            cuts.push(Cuts::new(&cells));
        }
        let size = vec2(width as f32, rows.end as f32);
        Some(Self { size, rows: Cuts::new(&totals), columns: cuts })
    }

    /// A point of the unit square and its density.
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let [point, ..] = self.sample_packet([u.x; LANES], [u.y; LANES], Mask::first(1));
        point
    }

    /// [`Partition::sample`] for the active ones of sixteen pairs of numbers.
    #[inline]
    pub fn sample_packet(&self, u: [f32; LANES], v: [f32; LANES], active: Mask) -> [(Vec2, f32); LANES] {
        let mut points = [(Vec2::ZERO, 0.0); LANES];
        for lane in active.lanes() {
            let (strip, y) = self.rows.sample(v[lane]);
            let (cell, x) = self.columns[strip].sample(u[lane]);
            points[lane] = (vec2(x, y) / self.size, self.density(strip, cell));
        }
        points
    }

    /// Density at a point.
    #[inline]
    pub fn pdf(&self, point: Vec2) -> f32 {
        let pixel = |x: f32, n: f32| (x * n).clamp(0.0, n - 1.0) as u32;
        let strip = self.rows.find(pixel(point.y, self.size.y));
        self.density(strip, self.columns[strip].find(pixel(point.x, self.size.x)))
    }

    #[inline(always)]
    fn density(&self, strip: usize, cell: usize) -> f32 {
        self.rows.density(strip) * self.columns[strip].density(cell) * self.size.x * self.size.y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng;

    fn unit(i: u64, k: u64) -> f32 {
        rng::unit(rng::combine(rng::mix(i), k))
    }

    #[test]
    fn densities_integrate_to_one_and_agree_with_their_samples() {
        let spots = |x: usize, y: usize| if (x * 7 + y * 13).is_multiple_of(31) { 50.0 } else { (x % 5) as f32 };
        for (width, height) in [(3, 3), (1, 1), (5, 1), (64, 33), (300, 200)] {
            let weights: Vec<f32> = (0..width * height).map(|i| spots(i % width, i / width)).collect();
            let Some(partition) = Partition::new(&weights, width) else {
                assert!(weights.iter().all(|&weight| weight == 0.0));
                continue;
            };
            let centre =
                |i: usize| vec2((i % width) as f32 + 0.5, (i / width) as f32 + 0.5) / vec2(width as f32, height as f32);
            let mean =
                (0..weights.len()).map(|i| f64::from(partition.pdf(centre(i)))).sum::<f64>() / weights.len() as f64;
            assert!((mean - 1.0).abs() < 1e-5, "{width}x{height}: {mean}");
            for i in 0..1000 {
                let (point, pdf) = partition.sample(vec2(unit(i, 0), unit(i, 1)));
                assert!((0.0..1.0).contains(&point.x) && (0.0..1.0).contains(&point.y));
                assert!(pdf > 0.0 && (partition.pdf(point) / pdf - 1.0).abs() < 1e-5, "{point} {pdf}");
                let pixel = (point.y * height as f32) as usize * width + (point.x * width as f32) as usize;
                let exact = weights.len() <= CELLS && height <= STRIPS;
                assert!(!exact || weights[pixel] > 0.0, "an empty pixel is drawn");
            }
        }
        assert!(Partition::new(&[0.0; 6], 3).is_none());
    }

    /// A sun of one pixel in a large dim sky takes nearly all samples that it is worth.
    #[test]
    fn small_suns_have_cells_of_their_own() {
        let (width, height) = (1024, 512);
        let mut weights: Vec<f32> = (0..width * height).map(|i| 1.0 + 0.1 * unit(i as u64, 0)).collect();
        let sun = 100 * width + 700;
        weights[sun] = 1e6;
        let partition = Partition::new(&weights, width).unwrap();
        let total: f64 = weights.iter().map(|&weight| f64::from(weight)).sum();
        let pdf = partition.pdf(vec2(700.5 / width as f32, 100.5 / height as f32));
        let ideal = 1e6 / total * weights.len() as f64;
        assert!((f64::from(pdf) / ideal - 1.0).abs() < 0.01, "{pdf} {ideal}");
    }
}
