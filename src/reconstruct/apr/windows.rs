//! Fits of all windows of an image. Windows are squares of blocks, and their sums are sums of the blocks' sums: every
//! pixel is looked at once, however wide the windows are and however many it belongs to.

use rayon::prelude::*;

use super::blocks::{Blocks, centre};
use super::design::{COLUMNS, ORDER, UNIT, columns, design};
use super::fit::{Fit, sums};
use crate::math::lanes::Lanes;

/// Blocks in a row of a tile, whose windows are fitted together.
const TILE: usize = 16;

/// A regression problem: colours, features and weights of all blocks.
pub struct Regression<'a> {
    /// Features that the colour is a linear function of, besides the position.
    pub features: &'a Blocks,
    /// Three channels.
    pub color: &'a Blocks,
    /// One over the variance; zero outside the image.
    pub weight: &'a Blocks,
}

/// The blocks of a rectangle.
#[derive(Clone)]
struct Range {
    x: std::ops::Range<usize>,
    y: std::ops::Range<usize>,
}

impl Range {
    fn blocks(&self) -> impl Iterator<Item = (usize, usize)> {
        let columns = self.x.clone();
        self.y.clone().flat_map(move |y| columns.clone().map(move |x| (x, y)))
    }
}

impl Regression<'_> {
    /// Fits the windows that reach `radius` blocks to each side of every block, row by row.
    pub fn fit(&self, radius: usize) -> Vec<Fit> {
        let (columns, rows) = (self.color.columns, self.color.rows);
        let tile = |x: usize, y: usize| Range { x: x..columns.min(x + TILE), y: y..rows.min(y + TILE) };
        let corners = (0..rows).step_by(TILE).flat_map(|y| (0..columns).step_by(TILE).map(move |x| (x, y)));
        let tiles: Vec<_> = corners.map(|(x, y)| tile(x, y)).collect();
        let done: Vec<_> = tiles.into_par_iter().map(|tile| (tile.clone(), self.fit_tile(&tile, radius))).collect();
        let mut fits = vec![Fit::default(); columns * rows];
        for (tile, of_tile) in done {
            tile.blocks().zip(of_tile).for_each(|((x, y), fit)| fits[y * columns + x] = fit);
        }
        fits
    }

    fn fit_tile(&self, tile: &Range, radius: usize) -> Vec<Fit> {
        let size = sums(self.features.channels);
        let around = |range: &std::ops::Range<usize>, end: usize| {
            range.start.saturating_sub(radius)..end.min(range.end + radius)
        };
        let reach = Range { x: around(&tile.x, self.color.columns), y: around(&tile.y, self.color.rows) };
        let middle = centre((tile.x.start + TILE / 2, tile.y.start + TILE / 2));
        let mut of_blocks = vec![0.0; size * reach.x.len() * reach.y.len()];
        for (block, slot) in reach.blocks().zip(of_blocks.chunks_exact_mut(size)) {
            self.add_block(block, middle, slot);
        }
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        let strip = Range { x: tile.x.clone(), y: reach.y.clone() };
        let mut of_strips = vec![0.0; size * strip.x.len() * strip.y.len()];
        for ((x, y), slot) in strip.blocks().zip(of_strips.chunks_exact_mut(size)) {
            for u in around(&(x..x + 1), reach.x.end) {
                let at = (y - reach.y.start) * reach.x.len() + u - reach.x.start;
                add(slot, &of_blocks[at * size..][..size]);
            }
        }
        let mut window = vec![0.0; size];
        let fit = |(x, y): (usize, usize)| {
            window.fill(0.0);
            for v in around(&(y..y + 1), reach.y.end) {
                let at = (v - strip.y.start) * strip.x.len() + x - strip.x.start;
                add(&mut window, &of_strips[at * size..][..size]);
            }
            let own = centre((x, y));
            let offset = (f64::from((own.0 - middle.0) / UNIT), f64::from((own.1 - middle.1) / UNIT));
            Fit::new(self.features.channels, &window, offset)
        };
        tile.blocks().map(fit).collect()
    }

    /// Sums of weighted products of a block's columns, and of columns with colours.
    fn add_block(&self, block: (usize, usize), middle: (f32, f32), sums: &mut [f64]) {
        let (x, y) = block;
        let design = design(self.features.at(x, y), block, middle);
        let count = columns(self.features.channels, ORDER);
        products(&design[..count], self.color.at(x, y), self.weight.at(x, y)[0], sums);
    }
}

vectorized! {
    fn products(columns: &[Lanes], color: &[Lanes], weight: Lanes, sums: &mut [f64]) {
        let mut weighted = [Lanes::ZERO; COLUMNS];
        for (slot, &column) in weighted.iter_mut().zip(columns) {
            *slot = weight * column;
        }
        let mut slots = sums.iter_mut();
        for i in 0..columns.len() {
            for (column, slot) in columns[..=i].iter().zip(&mut slots) {
                *slot = f64::from((weighted[i] * *column).sum());
            }
        }
        for weighted in &weighted[..columns.len()] {
            for (color, slot) in color.iter().zip(&mut slots) {
                *slot = f64::from((*weighted * *color).sum());
            }
        }
    }
}
