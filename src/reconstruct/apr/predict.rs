//! Prediction of a block by the windows around it: the mean of their fits of all orders, each weighted by its estimated
//! error there.

use super::blocks::{Blocks, centre};
use super::design::{ORDER, columns, design};
use super::fit::{Fit, entry};
use super::windows::Regression;
use crate::math::lanes::Lanes;

/// Radius, in blocks, of the windows' centres that predict a block.
const REACH: usize = 2;

/// Blocks at which a window counts 1/e of the block's own.
const SPREAD: f32 = 2.0;

/// Constant that is added to errors, in units of the pixel's variance, so that no fit decides alone.
const LEAST: f32 = 2e-3;

/// Channels of a prediction: colour, and how much of it is the pixel's own.
pub const CHANNELS: usize = 4;

/// Channel of [`CHANNELS`] that holds the leverage: the weight of a pixel's own colour in its prediction.
pub const LEVERAGE: usize = 3;

/// Fits to choose from.
pub struct Candidates<'a> {
    /// The regression problem.
    pub problem: &'a Regression<'a>,
    /// Fits of the windows of every block, for windows of different sizes.
    pub fits: &'a [Vec<Fit>],
    /// The lowest and the highest order that are used.
    pub orders: (usize, usize),
}

impl Candidates<'_> {
    /// Predicts all pixels. Errors are estimated by how far fits are from the `pilot`, or from the colour they were fitted
    /// to, of whose noise the fits have taken some part.
    pub fn predict(&self, pilot: Option<&Blocks>) -> Blocks {
        self.problem.color.map(|x, y| block(self, pilot, (x, y)))
    }
}

vectorized! {
    fn block(candidates: &Candidates, pilot: Option<&Blocks>, (x, y): (usize, usize)) -> [Lanes; CHANNELS] {
        let Regression { features, color, weight } = candidates.problem;
        let here = features.at(x, y);
        let (lowest, highest) = candidates.orders;
        let target = pilot.unwrap_or(color).at(x, y);
        let weight = weight.at(x, y)[0];
        let pixels: f32 = weight.0.iter().map(|&weight| f32::from(u8::from(weight > 0.0))).sum();
        let (mut sums, mut total) = ([Lanes::ZERO; CHANNELS], 0.0);
        for v in y.saturating_sub(REACH)..(y + REACH + 1).min(color.rows) {
            for u in x.saturating_sub(REACH)..(x + REACH + 1).min(color.columns) {
                let (du, dv) = (u as f32 - x as f32, v as f32 - y as f32);
                let near = (-(du * du + dv * dv) / (SPREAD * SPREAD)).exp();
                let columns_here = design(here, (x, y), centre((u, v)));
                for fits in candidates.fits {
                    let Fit { inverse, slopes } = &fits[v * color.columns + u];
                    let (mut fitted, mut leverage) = ([Lanes::ZERO; 3], Lanes::ZERO);
                    let mut m = 0;
                    for order in 0..=highest.min(ORDER) {
                        while m < columns(here.len(), order) {
                            let row = &inverse[entry(m, 0)..=entry(m, m)];
                            let mut q = Lanes::ZERO;
                            for (&factor, &column) in row.iter().zip(&columns_here) {
                                q += Lanes::splat(factor) * column;
                            }
                            leverage += q * q;
                            for c in 0..3 {
                                fitted[c] += q * Lanes::splat(slopes[m][c]);
                            }
                            m += 1;
                        }
                        if order < lowest {
                            continue;
                        }
                        let mut square = Lanes::ZERO;
                        for c in 0..3 {
                            let off = fitted[c] - target[c];
                            square += off * off;
                        }
                        // In units of the variance, which is the inverse of the weight: the variance of a fit is its leverage.
                        let leverage = weight * leverage;
                        let (off, variance) = ((weight * square).sum() / pixels, leverage.sum() / pixels);
                        let error = match pilot {
                            Some(_) => off + variance,
                            None => (off - 1.0 + 2.0 * variance).max(variance),
                        };
                        let share = near / (error + LEAST);
                        total += share;
                        let share = Lanes::splat(share);
                        for c in 0..3 {
                            sums[c] += share * fitted[c];
                        }
                        sums[LEVERAGE] += share * leverage;
                    }
                }
            }
        }
        sums.map(|sum| sum / Lanes::splat(total))
    }
}
