//! Columns of the regression: the constant, the features, and monomials of the position up to an order. Each order's
//! columns follow those of the one before, so that one factorisation serves all of them.

use super::blocks::coordinates;
use crate::math::lanes::Lanes;

/// Most features: normal, albedo, depth, occlusion, position and the generated one.
pub const FEATURES: usize = 14;

/// Monomials of two variables up to the third degree.
pub const MONOMIALS: usize = 10;

/// Most columns.
pub const COLUMNS: usize = FEATURES + MONOMIALS;

/// The highest order.
pub const ORDER: usize = 3;

/// Powers of the monomials.
pub const POWERS: [(i32, i32); MONOMIALS] =
    [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)];

/// Pixels that count as one in monomials: half the widest window.
pub const UNIT: f32 = 22.0;

/// Number of columns up to an order.
#[inline(always)]
pub fn columns(features: usize, order: usize) -> usize {
    features + (order + 1) * (order + 2) / 2
}

/// Position of a monomial among the columns.
#[inline(always)]
pub fn monomial_index(features: usize, monomial: usize) -> usize {
    if monomial == 0 { 0 } else { features + monomial }
}

/// The columns at a block's pixels, with positions relative to `centre`.
#[inline(always)]
pub fn design(features: &[Lanes], block: (usize, usize), centre: (f32, f32)) -> [Lanes; COLUMNS] {
    let mut columns = [Lanes::ZERO; COLUMNS];
    let [x, y] = coordinates(block, centre, 1.0 / UNIT);
    columns[0] = Lanes::splat(1.0);
    columns[1..=features.len()].copy_from_slice(features);
    let (xx, xy, yy) = (x * x, x * y, y * y);
    let monomials = [x, y, xx, xy, yy, xx * x, xx * y, x * yy, yy * y];
    columns[features.len() + 1..features.len() + MONOMIALS].copy_from_slice(&monomials);
    columns
}
