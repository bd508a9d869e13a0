//! The screened Poisson equation: with constant coefficients on a grid, and with a weight for every edge and pixel.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::dct::Dct2;
use super::graph::{Graph, Quad};
use super::multigrid::Multigrid;
use crate::film::Edges;

/// Solves min |α (u - data)|² + |Dx u - dx|² + |Dy u - dy|² exactly. Images are rows of `width`; the last column
/// of `dx` and the last row of `dy` are no edges and are not read. Needs α > 0.
pub fn screened(width: usize, data: &[f64], dx: &[f64], dy: &[f64], alpha: f64) -> Vec<f64> {
    let height = data.len() / width;
    let screen = alpha * alpha;
    let mut rhs = vec![0.0; data.len()];
    // α² data + Dxᵀ dx + Dyᵀ dy, each edge seen from both of its ends.
    rhs.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
        for (x, slot) in row.iter_mut().enumerate() {
            let i = y * width + x;
            let mut sum = screen * data[i];
            sum += if x > 0 { dx[i - 1] } else { 0.0 } - if x + 1 < width { dx[i] } else { 0.0 };
            sum += if y > 0 { dy[i - width] } else { 0.0 } - if y + 1 < height { dy[i] } else { 0.0 };
            *slot = sum;
        }
    });
    let dct = Dct2::new(width, height);
    dct.forward(&mut rhs);
    // Differences leave the mean to the data. Of the sum above only rounding would be left if the screen is weak, and it
    // would be divided by the screen.
    rhs[0] = screen * data.iter().sum::<f64>();
    let eigenvalues = |n: usize| (0..n).map(move |k| 4.0 * (PI * k as f64 / (2 * n) as f64).sin().powi(2));
    let across: Vec<f64> = eigenvalues(width).collect();
    let down: Vec<f64> = eigenvalues(height).collect();
    rhs.par_chunks_exact_mut(width).zip(&down).for_each(|(row, vertical)| {
        row.iter_mut().zip(&across).for_each(|(value, horizontal)| *value /= screen + horizontal + vertical);
    });
    dct.inverse(&mut rhs);
    rhs
}

/// Weights of a weighted problem: min Σ screen |u - data|² + Σ weight |u(higher) - u(lower) - difference|².
pub struct Weights {
    /// Weight of every edge's difference.
    pub edges: Vec<f32>,
    /// Weight of every pixel's value.
    pub screen: Vec<f32>,
}

/// An image and differences that a solution is to come near, in up to four channels.
#[derive(Clone, Copy)]
pub struct Targets<'a> {
    /// The pairs of pixels between which differences are known.
    pub edges: &'a Edges,
    /// Value of every pixel.
    pub data: &'a [Quad],
    /// Difference "higher end minus lower end" of every edge.
    pub differences: &'a [Quad],
}

impl Weights {
    /// Right-hand side of the normal equations.
    pub fn rhs(&self, targets: Targets) -> Vec<Quad> {
        let Targets { edges, data, differences } = targets;
        let value = |pixel: usize| {
            // Rounded once: what strong edges round off moves whole regions that only weak screening holds.
            let mut sum = data[pixel].map(|value| f64::from(self.screen[pixel]) * f64::from(value));
            for half in edges.around(pixel) {
                // A difference towards this pixel adds to it.
                let weight = f64::from(-half.sign * self.edges[half.edge]);
                (0..4).for_each(|c| sum[c] += weight * f64::from(differences[half.edge][c]));
            }
            sum.map(|sum| sum as f32)
        };
        (0..data.len()).into_par_iter().map(value).collect()
    }

    /// The solver of the normal equations.
    pub fn solver(&self, edges: &Edges) -> Multigrid {
        Multigrid::new(self.graph(edges))
    }

    /// The matrix of the normal equations.
    pub fn graph(&self, edges: &Edges) -> Graph {
        Graph::new(edges, &self.edges, &self.screen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(n: usize, seed: u64) -> Vec<f64> {
        (0..n as u64).map(|i| f64::from(crate::math::rng::unit(crate::math::rng::combine(seed, i))) - 0.5).collect()
    }

    /// (α² + DᵀD) u, written without looking at the solver.
    fn apply(width: usize, u: &[f64], alpha: f64) -> Vec<f64> {
        let height = u.len() / width;
        let mut result: Vec<f64> = u.iter().map(|value| alpha * alpha * value).collect();
        let mut edge = |i: usize, j: usize| {
            result[i] += u[i] - u[j];
            result[j] += u[j] - u[i];
        };
        for y in 0..height {
            for x in 0..width {
                let i = y * width + x;
                if x + 1 < width {
                    edge(i, i + 1);
                }
                if y + 1 < height {
                    edge(i, i + width);
                }
            }
        }
        result
    }

    #[test]
    fn the_normal_equations_hold() {
        for (width, height) in [(1, 1), (1, 9), (11, 1), (13, 7), (32, 20)] {
            let n = width * height;
            let (data, dx, dy) = (noise(n, 1), noise(n, 2), noise(n, 3));
            let u = screened(width, &data, &dx, &dy, 0.2);
            let mut right: Vec<f64> = data.iter().map(|value| 0.04 * value).collect();
            for i in 0..n {
                if i % width + 1 < width {
                    right[i] -= dx[i];
                    right[i + 1] += dx[i];
                }
                if i / width + 1 < height {
                    right[i] -= dy[i];
                    right[i + width] += dy[i];
                }
            }
            let left = apply(width, &u, 0.2);
            left.iter().zip(&right).for_each(|(a, b)| assert!((a - b).abs() < 1e-11, "{width}x{height}"));
        }
    }

    #[test]
    fn consistent_gradients_are_a_fixed_point_and_the_mean_is_kept() {
        let (width, height) = (24, 17);
        let u = noise(width * height, 4);
        let step = |i: usize, by: usize| u.get(i + by).map_or(0.0, |next| next - u[i]);
        let dx: Vec<f64> = (0..u.len()).map(|i| step(i, 1)).collect();
        let dy: Vec<f64> = (0..u.len()).map(|i| step(i, width)).collect();
        let same = screened(width, &u, &dx, &dy, 0.2);
        same.iter().zip(&u).for_each(|(a, b)| assert!((a - b).abs() < 1e-12));
        let other = screened(width, &u, &noise(u.len(), 5), &noise(u.len(), 6), 0.01);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        assert!((mean(&other) - mean(&u)).abs() < 1e-12);
    }
}
