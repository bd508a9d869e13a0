//! Sampling a point of an image in proportion to its brightness, by cells that are small where the image varies and few
//! enough for the cache. Cells follow each other as they are cut, so that numbers that are close together give points that
//! are.

use std::collections::BinaryHeap;
use std::ops::Range;

use super::lanes::{LANES, Mask};
use super::{Vec2, vec2};

/// Most cells: with their place and the sums of their weights they take a third of a megabyte.
const CELLS: usize = 1 << 14;

/// A rectangle of the image that is cut in two, or a cell.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// The first of two nodes that follow each other; zero for a cell.
    children: u32,
    /// Column that the second child begins with, or row plus [`DOWN`]; of a cell its number.
    cut: u32,
}

/// Marks cuts between rows.
const DOWN: u32 = 1 << 31;

/// Corner and size of a cell, in pixels.
type CellRect = [u32; 4];

/// A piecewise-constant density over the unit square.
#[derive(Clone, Debug)]
pub struct Partition {
    size: [u32; 2],
    /// Cuts, from the whole image on.
    nodes: Vec<Node>,
    cells: Vec<CellRect>,
    /// Running sums of the cells' weights as 32-bit shares of the total.
    sums: Vec<u32>,
    /// The cells that the starts of some equal parts of the total fall on, so that searches are short.
    guide: Vec<u32>,
    /// Density of a cell of one pixel that has all of the weight, over the largest share.
    per_share: f32,
}

/// Sums over rectangles from the corner on, of weights and of their squares.
struct Sums {
    width: usize,
    sums: Vec<[f64; 2]>,
}

impl Sums {
    fn new(weights: &[f32], width: usize) -> Self {
        let mut sums = vec![[0.0; 2]; width + 1];
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

    /// Weight of a rectangle if it is one cell: what makes the variance of a constant density inside of it least.
    fn weight(&self, cell: &Cell) -> [f64; 2] {
        let at = |x: u32, y: u32| self.sums[y as usize * self.width + x as usize];
        let (x, y) = (&cell.columns, &cell.rows);
        let [all, top, left, both] = [at(x.end, y.end), at(x.end, y.start), at(x.start, y.end), at(x.start, y.start)];
        let [sum, squares] = [0, 1].map(|k: usize| (all[k] - top[k] - left[k] + both[k]).max(0.0));
        let area = f64::from(x.end - x.start) * f64::from(y.end - y.start);
        // Rounding must not make a cell less likely than what is in it.
        [sum, if sum > 0.0 { (area * squares).sqrt().max(sum) } else { 0.0 }]
    }
}

/// A rectangle that may still be cut.
#[derive(Clone, Debug)]
struct Cell {
    node: usize,
    columns: Range<u32>,
    rows: Range<u32>,
    /// Weight as one cell.
    weight: f64,
    /// How much the weight exceeds the sum of what is in it.
    excess: f64,
}

impl Cell {
    fn new(node: usize, columns: Range<u32>, rows: Range<u32>, sums: &Sums) -> Self {
        let mut cell = Self { node, columns, rows, weight: 0.0, excess: 0.0 };
        let [sum, weight] = sums.weight(&cell);
        (cell.weight, cell.excess) = (weight, weight - sum);
        cell
    }

    /// The middle of the longer side, if the cell is more than a pixel.
    fn cut(&self) -> Option<u32> {
        let (width, height) = (self.columns.end - self.columns.start, self.rows.end - self.rows.start);
        match (width >= height, width.max(height)) {
            (_, 0 | 1) => None,
            (true, _) => Some(self.columns.start + width / 2),
            (false, _) => Some((self.rows.start + height / 2) | DOWN),
        }
    }
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Cell {}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.excess.total_cmp(&other.excess).then(other.node.cmp(&self.node))
    }
}

impl Partition {
    /// Weights of `width` pixels a row, row by row; finite and not negative. `None` when all are zero.
    pub fn new(weights: &[f32], width: usize) -> Option<Self> {
        let size = [width as u32, (weights.len() / width) as u32];
        let sums = Sums::new(weights, width);
        let root = Cell::new(0, 0..size[0], 0..size[1], &sums);
        if !(root.weight > 0.0 && root.weight.is_finite()) {
            return None;
        }
        let mut nodes = vec![Node { children: 0, cut: 0 }];
        let (mut open, mut cells) = (BinaryHeap::from([root]), Vec::new());
        // The cell that is least even is cut first.
        while let Some(cell) = open.pop() {
            let cut = cell.cut().filter(|_| cell.excess > 0.0 && open.len() + cells.len() + 1 < CELLS);
            let Some(cut) = cut else {
                cells.push(cell);
                continue;
            };
            let Cell { columns: x, rows: y, .. } = &cell;
            let at = cut & !DOWN;
            let halves = match cut & DOWN {
                0 => [(x.start..at, y.clone()), (at..x.end, y.clone())],
                _ => [(x.clone(), y.start..at), (x.clone(), at..y.end)],
            };
            let children = nodes.len();
            nodes[cell.node] = Node { children: children as u32, cut };
            for (k, (columns, rows)) in halves.into_iter().enumerate() {
                nodes.push(Node { children: 0, cut: 0 });
                open.push(Cell::new(children + k, columns, rows, &sums));
            }
        }
        Some(Self::with_cells(size, nodes, cells))
    }

    /// Numbers the cells in the order of the tree, in which neighbours are mostly close together.
    fn with_cells(size: [u32; 2], mut nodes: Vec<Node>, cells: Vec<Cell>) -> Self {
        let mut by_node: Vec<Option<Cell>> = vec![None; nodes.len()];
        let total: f64 = cells.iter().map(|cell| cell.weight).sum();
        cells.into_iter().for_each(|cell| {
            let node = cell.node;
            by_node[node] = Some(cell);
        });
        let (mut rects, mut sums, mut sum) = (Vec::new(), vec![0], 0.0);
        let mut way = vec![0];
        while let Some(node) = way.pop() {
            let Node { children, .. } = nodes[node];
            let Some(cell) = by_node[node].take() else {
                way.extend([children as usize + 1, children as usize]);
                continue;
            };
            nodes[node].cut = rects.len() as u32;
            let (x, y) = (cell.columns, cell.rows);
            rects.push([x.start, y.start, x.end - x.start, y.end - y.start]);
            sum += cell.weight;
            sums.push((sum / total * f64::from(u32::MAX)) as u32);
        }
        // The last sum is all there is, whatever rounding has made of it.
        sums[rects.len()] = u32::MAX;
        let parts = rects.len().div_ceil(PART);
        let guide = (0..parts).map(|part| {
            let target = (part as f64 / parts as f64 * f64::from(u32::MAX)) as u32;
            sums.partition_point(|&sum| sum <= target).saturating_sub(1).min(rects.len() - 1) as u32
        });
        let per_share = (f64::from(size[0]) * f64::from(size[1]) / f64::from(u32::MAX)) as f32;
        Self { size, nodes, guide: guide.collect(), cells: rects, sums, per_share }
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
            let (cell, rest) = self.search(u[lane]);
            let [x, y, width, height] = self.cells[cell].map(|value| value as f32);
            // Rounding up would leave the cell.
            let place = |low: f32, size: f32, at: f32| (low + at * size).min((low + size).next_down());
            let at = vec2(place(x, width, rest), place(y, height, v[lane]));
            points[lane] = (at / vec2(self.size[0] as f32, self.size[1] as f32), self.density(cell));
        }
        points
    }

    /// The cell that `u` in [0, 1) falls on, and `u` stretched to [0, 1) within it.
    #[inline(always)]
    fn search(&self, u: f32) -> (usize, f32) {
        let sums = &self.sums;
        let target = (f64::from(u) * f64::from(u32::MAX)) as u32;
        let part = ((u * self.guide.len() as f32) as usize).min(self.guide.len() - 1);
        let (mut index, last) = (self.guide[part] as usize, self.cells.len() - 1);
        while index < last && sums[index + 1] <= target {
            index += 1;
        }
        // Positions are computed in floats, which may round up; and a cell without weight may stand beside the one meant.
        while index > 0 && (sums[index] > target || sums[index + 1] == sums[index]) {
            index -= 1;
        }
        let (low, high) = (sums[index], sums[index + 1]);
        let rest = if high > low { target.saturating_sub(low) as f32 / (high - low) as f32 } else { 0.0 };
        (index, rest.clamp(0.0, 1.0 - f32::EPSILON / 2.0))
    }

    #[inline(always)]
    fn density(&self, cell: usize) -> f32 {
        let [.., width, height] = self.cells[cell];
        (self.sums[cell + 1] - self.sums[cell]) as f32 * self.per_share / (width as f32 * height as f32)
    }

    /// Density at a point.
    pub fn pdf(&self, point: Vec2) -> f32 {
        let pixel = |x: f32, n: u32| ((x * n as f32) as u32).min(n - 1);
        let pixel = [pixel(point.x, self.size[0]), pixel(point.y, self.size[1])];
        let mut node = self.nodes[0];
        while node.children > 0 {
            let second = pixel[(node.cut >> 31) as usize] >= node.cut & !DOWN;
            node = self.nodes[node.children as usize + usize::from(second)];
        }
        self.density(node.cut as usize)
    }
}

/// Cells for each part of the guide, on average.
const PART: usize = 2;

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
                assert!(weights.len() > CELLS || weights[pixel] > 0.0, "an empty pixel is drawn");
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
