//! Small systems solved directly in double precision: what iterative solvers in single precision are held against.

use super::frame::random;
use crate::solve::graph::Quad;
use crate::solve::poisson::{Data, Weights};

/// Solves a symmetric positive definite system by Cholesky's method. `a` holds rows of the whole matrix.
pub fn direct(mut a: Vec<f64>, mut x: Vec<f64>) -> Vec<f64> {
    let n = x.len();
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| a[i * n + k] * a[j * n + k]).sum();
            let rest = a[i * n + j] - known;
            // Rounding may leave nothing of what is tiny beside the rest.
            a[i * n + j] = if i == j { rest.max(1e-300).sqrt() } else { rest / a[j * n + j] };
        }
        let known: f64 = (0..i).map(|k| a[i * n + k] * x[k]).sum();
        x[i] = (x[i] - known) / a[i * n + i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| a[k * n + i] * x[k]).sum();
        x[i] = (x[i] - known) / a[i * n + i];
    }
    x
}

/// An image to be found from its values and differences: one channel of a weighted Poisson problem.
pub struct Problem {
    pub width: usize,
    pub data: Vec<Quad>,
    pub edges: [Vec<Quad>; 2],
}

impl Problem {
    /// Values and differences that contradict each other.
    pub fn new(width: usize, height: usize, seed: u64) -> Self {
        let values = |k: u64| (0..width * height).map(|i| [random(seed + k, i) - 0.5, 0.0, 0.0, 0.0]).collect();
        Self { width, data: values(1), edges: [values(2), values(3)] }
    }

    pub fn data(&self) -> Data<'_> {
        Data { width: self.width, data: &self.data, edges: [&self.edges[0], &self.edges[1]] }
    }

    /// Edges as pairs of pixels, with their differences and their places among the weights of an axis.
    fn edges(&self) -> impl Iterator<Item = (usize, usize, f64, usize)> {
        let n = self.data.len();
        let at = move |axis: usize, i: usize, step: usize| (i, i + step, f64::from(self.edges[axis][i][0]), axis);
        let across = (0..n).filter(move |i| (i + 1) % self.width != 0).map(move |i| at(0, i, 1));
        let down = (0..n).filter(move |i| i + self.width < n).map(move |i| at(1, i, self.width));
        across.chain(down)
    }

    /// Σ weight |residual|^p over data and edges.
    pub fn cost(&self, weights: &Weights, u: &[f64], p: i32) -> f64 {
        let own =
            (0..u.len()).map(|i| f64::from(weights.screen[i]) * (u[i] - f64::from(self.data[i][0])).abs().powi(p));
        let edge = |(i, j, d, axis): (usize, usize, f64, usize)| {
            f64::from([&weights.across, &weights.down][axis][i]) * (u[j] - u[i] - d).abs().powi(p)
        };
        own.sum::<f64>() + self.edges().map(edge).sum::<f64>()
    }

    /// The least squares solution.
    pub fn solve(&self, screen: &[f64], across: &[f64], down: &[f64]) -> Vec<f64> {
        let n = self.data.len();
        let (mut a, mut b) = (vec![0.0; n * n], vec![0.0; n]);
        for i in 0..n {
            a[i * n + i] += screen[i];
            b[i] += screen[i] * f64::from(self.data[i][0]);
        }
        for (i, j, d, axis) in self.edges() {
            let weight = [across, down][axis][i];
            a[i * n + i] += weight;
            a[j * n + j] += weight;
            a[i * n + j] -= weight;
            a[j * n + i] -= weight;
            b[i] -= weight * d;
            b[j] += weight * d;
        }
        direct(a, b)
    }

    /// Minimises α Σ |u - data| + Σ |differences|, by reweighting until nothing changes.
    pub fn solve_l1(&self, alpha: f64) -> Vec<f64> {
        let n = self.data.len();
        let mut u: Vec<f64> = self.data.iter().map(|quad| f64::from(quad[0])).collect();
        for k in 0..200 {
            let epsilon = 0.05 * 0.8f64.powi(k).max(1e-9);
            let screen: Vec<_> =
                (0..n).map(|i| alpha / ((u[i] - f64::from(self.data[i][0])).abs() + epsilon)).collect();
            let mut weights = [vec![0.0; n], vec![0.0; n]];
            for (i, j, d, axis) in self.edges() {
                weights[axis][i] = 1.0 / ((u[j] - u[i] - d).abs() + epsilon);
            }
            u = self.solve(&screen, &weights[0], &weights[1]);
        }
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_is_solved() {
        let x = direct(vec![4.0, 2.0, 2.0, 3.0], vec![8.0, 8.0]);
        assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] - 2.0).abs() < 1e-12);
    }
}
