//! Small systems solved directly in double precision: what iterative solvers in single precision are held against.

use crate::film::Edges;
use crate::solve::graph::Quad;
use crate::solve::poisson::{Targets, Weights};
use crate::synthetic::random;

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
pub struct System {
    pub edges: Edges,
    pub data: Vec<Quad>,
    pub differences: Vec<Quad>,
}

impl System {
    /// Values and differences that contradict each other.
    pub fn new(width: usize, height: usize, seed: u64) -> Self {
        let value = |k: u64, i: usize| [random(seed + k, i) - 0.5, 0.0, 0.0, 0.0];
        let edges = Edges::cross((width, height));
        let of_edge = |edge: usize| value(2 + edges.kind(edge) as u64, edges.ends(edge)[0]);
        let differences = (0..edges.len()).map(of_edge).collect();
        Self { data: (0..width * height).map(|i| value(1, i)).collect(), differences, edges }
    }

    pub fn targets(&self) -> Targets<'_> {
        Targets { edges: &self.edges, data: &self.data, differences: &self.differences }
    }

    /// Differences along an axis as a dense image, as the solver on grids takes them.
    pub fn grid(&self, axis: usize) -> Vec<f64> {
        let mut grid = vec![0.0; self.data.len()];
        for edge in (0..self.edges.len()).filter(|&edge| self.edges.kind(edge) == axis) {
            grid[self.edges.ends(edge)[0]] = f64::from(self.differences[edge][0]);
        }
        grid
    }

    /// Residual of an edge's difference.
    fn residual(&self, u: &[f64], edge: usize) -> f64 {
        let [lower, higher] = self.edges.ends(edge);
        u[higher] - u[lower] - f64::from(self.differences[edge][0])
    }

    /// Σ weight |residual|^p over data and edges.
    pub fn cost(&self, weights: &Weights, u: &[f64], p: i32) -> f64 {
        let own =
            (0..u.len()).map(|i| f64::from(weights.screen[i]) * (u[i] - f64::from(self.data[i][0])).abs().powi(p));
        let of_edge = |edge: usize| f64::from(weights.edges[edge]) * self.residual(u, edge).abs().powi(p);
        own.sum::<f64>() + (0..self.edges.len()).map(of_edge).sum::<f64>()
    }

    /// The least squares solution.
    pub fn solve(&self, screen: &[f64], weights: &[f64]) -> Vec<f64> {
        let n = self.data.len();
        let (mut a, mut b) = (vec![0.0; n * n], vec![0.0; n]);
        for i in 0..n {
            a[i * n + i] += screen[i];
            b[i] += screen[i] * f64::from(self.data[i][0]);
        }
        for (edge, &weight) in weights.iter().enumerate() {
            let [i, j] = self.edges.ends(edge);
            let d = f64::from(self.differences[edge][0]);
            a[i * n + i] += weight;
            a[j * n + j] += weight;
            a[i * n + j] -= weight;
            a[j * n + i] -= weight;
            b[i] -= weight * d;
            b[j] += weight * d;
        }
        direct(a, b)
    }

    /// Minimises α Σ |u - data| + Σ |residual of differences|, by reweighting until nothing changes.
    pub fn solve_l1(&self, alpha: f64) -> Vec<f64> {
        let n = self.data.len();
        let mut u: Vec<f64> = self.data.iter().map(|quad| f64::from(quad[0])).collect();
        for k in 0..200 {
            let epsilon = 0.05 * 0.8f64.powi(k).max(1e-9);
            let screen: Vec<_> =
                (0..n).map(|i| alpha / ((u[i] - f64::from(self.data[i][0])).abs() + epsilon)).collect();
            let weights: Vec<_> =
                (0..self.edges.len()).map(|edge| 1.0 / (self.residual(&u, edge).abs() + epsilon)).collect();
            u = self.solve(&screen, &weights);
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
