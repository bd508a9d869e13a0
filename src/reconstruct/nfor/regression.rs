//! Collaborative first-order regression: around every pixel the colour is fitted as a linear function of position and
//! features, and the whole fitted window counts, with the weights it was fitted by.

use rayon::prelude::*;

use crate::image::nl_means::{self, Guide, NlmSettings};
use crate::image::planes::{PlaneTile, Planes, TILE};
use crate::math::lanes::{LANES, Lanes};

/// Features.
pub const FEATURES: usize = 7;

/// Constant, position and features.
const COLUMNS: usize = 3 + FEATURES;

/// Entries of a symmetric matrix of the columns, row by row up to the diagonal.
const ENTRIES: usize = COLUMNS * (COLUMNS + 1) / 2;

/// Radius of the windows, and of the patches that weights compare.
pub const WINDOW: usize = 9;
const PATCH: usize = 3;
const OFFSETS: usize = (2 * WINDOW + 1) * (2 * WINDOW + 1);

/// Ridge of a column's slope, as a mean square that is added to the column's: what varies by
/// a three-hundredth of its range or less explains nothing.
const RIDGE: f32 = 1e-5;

/// Fits `color` by `features`; pixels count by how alike they are in `guide`, up to `tolerance` standard deviations.
pub fn regress(color: &Planes, features: &Planes, guide: &Guide, tolerance: f32) -> Planes {
    let (width, height) = (color.width, color.height);
    let settings = NlmSettings { window: WINDOW, patch: PATCH, color: tolerance, feature: None };
    let mut sums = vec![0.0; 4 * width * height];
    for y in (0..height).step_by(TILE) {
        let tile = |x| PlaneTile { x, y, width: TILE.min(width - x), height: TILE.min(height - y) };
        let lefts: Vec<_> = (0..width).step_by(TILE).collect();
        let fits = lefts.into_par_iter().map(|x| {
            let tile = tile(x);
            (tile, fit_tile(color, features, &nl_means::weights(guide, settings, tile), tile))
        });
        // Windows reach into other tiles: sums are added up in the same order on any number of threads.
        for (tile, fits) in fits.collect::<Vec<_>>() {
            add(&mut sums, (width, height), &fits, tile);
        }
    }
    let pixels = width * height;
    Planes::from_fn(width, height, 3, |c, x, y| {
        let at = y * width + x;
        sums[c * pixels + at] / sums[3 * pixels + at]
    })
}

/// Floats in a row and rows of a tile with the windows around it.
fn reach(tile: PlaneTile) -> (usize, usize) {
    (tile.width.next_multiple_of(LANES) + 2 * WINDOW, tile.height + 2 * WINDOW)
}

/// Adds a tile's sums to those of the image, the part that is inside.
fn add(sums: &mut [f32], (width, height): (usize, usize), fits: &[f32], tile: PlaneTile) {
    let (stride, rows) = reach(tile);
    let columns = WINDOW.saturating_sub(tile.x)..(tile.width + 2 * WINDOW).min(width + WINDOW - tile.x);
    for (i, row) in fits.chunks_exact(stride).enumerate() {
        let (plane, y) = (i / rows, tile.y + i % rows);
        if (WINDOW..height + WINDOW).contains(&y) {
            let at = (plane * height + y - WINDOW) * width + tile.x + columns.start - WINDOW;
            let row = &row[columns.clone()];
            sums[at..at + row.len()].iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
    }
}

/// Columns of the regression at [`LANES`] pixels, relative to the windows' centres.
#[inline(always)]
fn columns(features: &Planes, centre: &[Lanes; FEATURES], q: (isize, isize), step: (isize, isize)) -> [Lanes; COLUMNS] {
    let scaled = |step: isize| Lanes::splat(step as f32 / WINDOW as f32);
    let mut columns = [Lanes::splat(1.0); COLUMNS];
    columns[1] = scaled(step.0);
    columns[2] = scaled(step.1);
    for k in 0..FEATURES {
        columns[3 + k] = features.lanes(k, q.0, q.1) - centre[k];
    }
    columns
}

vectorized! {
    /// Weighted sums of the fitted colours and of the weights, over a tile and the windows' margin around it.
    fn fit_tile(color: &Planes, features: &Planes, weights: &[f32], tile: PlaneTile) -> Vec<f32> {
        let r = WINDOW as isize;
        let (stride, rows) = reach(tile);
        let mut out = vec![0.0; 4 * stride * rows];
        for ((x, y), weights) in tile.blocks().zip(weights.chunks_exact(OFFSETS * LANES)) {
            let at = ((tile.x + x) as isize, (tile.y + y) as isize);
            let centre: [Lanes; FEATURES] = std::array::from_fn(|k| features.lanes(k, at.0, at.1));
            let here: [Lanes; 3] = std::array::from_fn(|c| color.lanes(c, at.0, at.1));
            let weight = |k: usize| Lanes::load(&weights[k * LANES..]);
            let mut matrix = [Lanes::ZERO; ENTRIES];
            let mut right = [[Lanes::ZERO; COLUMNS]; 3];
            let mut k = 0;
            for dy in -r..=r {
                for dx in -r..=r {
                    let q = (at.0 + dx, at.1 + dy);
                    let columns = columns(features, &centre, q, (dx, dy));
                    let weight = weight(k);
                    k += 1;
                    let values: [Lanes; 3] = std::array::from_fn(|c| color.lanes(c, q.0, q.1) - here[c]);
                    let mut entry = 0;
                    for i in 0..COLUMNS {
                        let weighted = weight * columns[i];
                        for &column in &columns[..=i] {
                            matrix[entry] += weighted * column;
                            entry += 1;
                        }
                        for c in 0..3 {
                            right[c][i] += weighted * values[c];
                        }
                    }
                }
            }
            solve(&mut matrix, &mut right);
            let mut k = 0;
            for dy in -r..=r {
                for dx in -r..=r {
                    let columns = columns(features, &centre, (at.0 + dx, at.1 + dy), (dx, dy));
                    let weight = weight(k);
                    k += 1;
                    let to = (y as isize + dy + r) as usize * stride + (x as isize + dx + r) as usize;
                    for c in 0..3 {
                        let mut fit = here[c];
                        for i in 0..COLUMNS {
                            fit += right[c][i] * columns[i];
                        }
                        let slot = &mut out[c * stride * rows + to..];
                        (Lanes::load(slot) + weight * fit).store(slot);
                    }
                    let slot = &mut out[3 * stride * rows + to..];
                    (Lanes::load(slot) + weight).store(slot);
                }
            }
        }
        out
    }
}

/// Solves symmetric systems in place, by Cholesky decomposition: slopes take the place of right-hand sides.
#[inline(always)]
fn solve(matrix: &mut [Lanes; ENTRIES], right: &mut [[Lanes; COLUMNS]; 3]) {
    let entry = |i: usize, j: usize| i * (i + 1) / 2 + j;
    let ridge = matrix[0] * Lanes::splat(RIDGE);
    let mut inverse = [Lanes::ZERO; COLUMNS];
    for i in 0..COLUMNS {
        if i > 0 {
            matrix[entry(i, i)] += ridge;
        }
        for j in 0..=i {
            let mut rest = matrix[entry(i, j)];
            for k in 0..j {
                rest = rest - matrix[entry(i, k)] * matrix[entry(j, k)];
            }
            if i == j {
                // The ridge bounds it from below; rounding might not.
                inverse[i] = Lanes::splat(1.0) / rest.max(ridge * Lanes::splat(0.1)).max(Lanes::splat(1e-30)).sqrt();
            } else {
                matrix[entry(i, j)] = rest * inverse[j];
            }
        }
    }
    for right in right {
        for i in 0..COLUMNS {
            let mut rest = right[i];
            for k in 0..i {
                rest = rest - matrix[entry(i, k)] * right[k];
            }
            right[i] = rest * inverse[i];
        }
        for i in (0..COLUMNS).rev() {
            let mut rest = right[i];
            for k in i + 1..COLUMNS {
                rest = rest - matrix[entry(k, i)] * right[k];
            }
            right[i] = rest * inverse[i];
        }
    }
}
