//! The least squares fits of one window, of all orders at once, from its sums.

use super::design::{COLUMNS, MONOMIALS, ORDER, POWERS, columns, monomial_index};

/// A window's fits: columns made orthogonal to those before them, and the colours' coefficients for each. The fit of an
/// order is the sum over its columns.
#[derive(Clone, Debug, Default)]
pub struct Fit {
    /// Rows of the inverse of the Cholesky factor up to the diagonal, one after the other.
    pub inverse: Vec<f32>,
    /// Coefficients.
    pub slopes: Vec<[f32; 3]>,
}

/// Ridge of a feature's slope, as a mean square that is added to the feature's: what varies by
/// a hundredth of its range or less explains nothing.
const RIDGE: f64 = 1e-4;

/// Columns of which less than this share is new add nothing but rounding.
const NEW: f64 = 1e-3;

type Matrix = [[f64; COLUMNS]; COLUMNS];

/// Position of an entry in a packed lower triangle.
#[inline(always)]
pub fn entry(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// Number of sums that a window has.
pub fn sums(features: usize) -> usize {
    let columns = columns(features, ORDER);
    entry(columns, 0) + 3 * columns
}

impl Fit {
    /// Fits by sums of products of columns, lower triangle row by row, and of columns with colours. Positions in them are
    /// relative to a point; the window's centre is at `offset` from there, in the unit of monomials.
    pub fn new(features: usize, sums: &[f64], offset: (f64, f64)) -> Self {
        let p = columns(features, ORDER);
        let (mut matrix, mut right) = ([[0.0; COLUMNS]; COLUMNS], [[0.0; 3]; COLUMNS]);
        for i in 0..p {
            for j in 0..=i {
                matrix[i][j] = sums[entry(i, j)];
                matrix[j][i] = matrix[i][j];
            }
            right[i].copy_from_slice(&sums[entry(p, 0) + 3 * i..][..3]);
        }
        translate(&mut matrix, &mut right, features, offset);
        orthogonalise(&matrix, &right, features)
    }
}

/// Takes monomials about another point: they are combinations of those of lower degrees about the old one.
fn translate(matrix: &mut Matrix, right: &mut [[f64; 3]; COLUMNS], features: usize, offset: (f64, f64)) {
    let binomial = [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [1.0, 2.0, 1.0, 0.0], [1.0, 3.0, 3.0, 1.0]];
    let power = |base: f64| [1.0, base, base * base, base * base * base];
    let (dx, dy) = (power(-offset.0), power(-offset.1));
    let p = columns(features, ORDER);
    // From the highest on, since lower ones are still needed as they were.
    let mut terms = Vec::with_capacity(MONOMIALS * MONOMIALS / 2);
    for m in (1..MONOMIALS).rev() {
        let (a, b) = POWERS[m];
        for (n, &(i, j)) in POWERS[..m].iter().enumerate().filter(|(_, (i, j))| *i <= a && *j <= b) {
            let factor = binomial[a as usize][i as usize] * binomial[b as usize][j as usize];
            terms.push((
                monomial_index(features, m),
                monomial_index(features, n),
                factor * dx[(a - i) as usize] * dy[(b - j) as usize],
            ));
        }
    }
    for &(to, from, factor) in &terms {
        let (source, of_right) = (matrix[from], right[from]);
        (0..p).for_each(|k| matrix[to][k] += factor * source[k]);
        (0..3).for_each(|c| right[to][c] += factor * of_right[c]);
    }
    for &(to, from, factor) in &terms {
        matrix[..p].iter_mut().for_each(|row| row[to] += factor * row[from]);
    }
}

/// Cholesky decomposition, the inverse of the factor, and the right-hand sides times that.
fn orthogonalise(matrix: &Matrix, right: &[[f64; 3]; COLUMNS], features: usize) -> Fit {
    let p = columns(features, ORDER);
    let (mut l, mut inverse): (Matrix, Matrix) = ([[0.0; COLUMNS]; COLUMNS], [[0.0; COLUMNS]; COLUMNS]);
    let mut fit = Fit { inverse: vec![0.0; entry(p, 0)], slopes: vec![[0.0; 3]; p] };
    for i in 0..p {
        for j in 0..i {
            let known: f64 = l[i][..j].iter().zip(&l[j][..j]).map(|(a, b)| a * b).sum();
            l[i][j] = if l[j][j] > 0.0 { (matrix[i][j] - known) / l[j][j] } else { 0.0 };
        }
        let feature = (1..=features).contains(&i);
        let (ridge, least) = if feature { (RIDGE * matrix[0][0], 0.0) } else { (0.0, NEW * matrix[i][i]) };
        let rest = matrix[i][i] - l[i][..i].iter().map(|value| value * value).sum::<f64>();
        if rest <= least {
            continue;
        }
        l[i][i] = (rest + ridge).sqrt();
        let mut row = [0.0; COLUMNS];
        row[i] = 1.0 / l[i][i];
        for (j, slot) in row[..i].iter_mut().enumerate() {
            let known: f64 = (j..i).map(|k| l[i][k] * inverse[k][j]).sum();
            *slot = -known / l[i][i];
        }
        let slots = &mut fit.inverse[entry(i, 0)..=entry(i, i)];
        slots.iter_mut().zip(&row).for_each(|(slot, &value)| *slot = value as f32);
        fit.slopes[i] = [0, 1, 2].map(|c| row[..=i].iter().zip(right).map(|(a, b)| a * b[c]).sum::<f64>() as f32);
        inverse[i] = row;
    }
    fit
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The column values of a point, monomials about `centre`.
    fn row(feature: f64, (x, y): (f64, f64), centre: (f64, f64)) -> Vec<f64> {
        let (x, y) = (x - centre.0, y - centre.1);
        let monomial = |&(a, b): &(i32, i32)| x.powi(a) * y.powi(b);
        let mut row = vec![1.0, feature];
        row.extend(POWERS[1..].iter().map(monomial));
        row
    }

    #[test]
    fn each_order_is_the_least_squares_fit_about_any_point() {
        let points: Vec<_> = (0..400).map(|i| (f64::from(i % 20) / 10.0, f64::from(i / 20) / 10.0)).collect();
        let feature = |x: f64, y: f64| (5.0 * x).sin() * (3.0 * y).cos();
        let truth = |x: f64, y: f64| 1.0 + 2.0 * feature(x, y) + x - 3.0 * y + 0.5 * x * x - x * y + 0.2 * x * y * y;
        let mut sums = vec![0.0; super::sums(1)];
        for &(x, y) in &points {
            let row = row(feature(x, y), (x, y), (0.0, 0.0));
            let mut at = 0;
            for (i, a) in row.iter().enumerate() {
                for b in &row[..=i] {
                    sums[at] += a * b;
                    at += 1;
                }
            }
            for a in &row {
                sums[at] += a * truth(x, y);
                at += 3;
            }
        }
        let centre = (1.0, 0.7);
        let fit = Fit::new(1, &sums, centre);
        let mut squares = [0.0; ORDER + 1];
        for &(x, y) in &points {
            let row = row(feature(x, y), (x, y), centre);
            let mut value = 0.0;
            for m in 0..row.len() {
                let q: f64 = (0..=m).map(|n| f64::from(fit.inverse[entry(m, n)]) * row[n]).sum();
                value += q * f64::from(fit.slopes[m][0]);
                for (order, square) in squares.iter_mut().enumerate() {
                    *square += if m + 1 == columns(1, order) { (value - truth(x, y)).powi(2) } else { 0.0 };
                }
            }
        }
        assert!(squares[0] > squares[1] && squares[1] > squares[2] && squares[2] > 100.0 * squares[3], "{squares:?}");
        assert!(squares[3] < 1e-4, "{squares:?}");
    }

    #[test]
    fn columns_that_say_nothing_new_are_left_out() {
        // Two points and the constant: one slope, and no more.
        let mut sums = vec![0.0; super::sums(1)];
        for (x, value) in [(-0.5, 1.0), (0.5, 2.0)] {
            let row = row(x, (x, 0.0), (0.0, 0.0));
            let mut at = 0;
            for (i, a) in row.iter().enumerate() {
                row[..=i].iter().for_each(|b| {
                    sums[at] += a * b;
                    at += 1;
                });
            }
            for a in &row {
                sums[at] += a * value;
                at += 3;
            }
        }
        let fit = Fit::new(1, &sums, (0.0, 0.0));
        assert!(fit.inverse.iter().all(|value| value.is_finite()));
        assert_eq!(fit.slopes.iter().filter(|slopes| slopes[0] != 0.0).count(), 2);
    }
}
