//! Screened Poisson reconstruction in the L1 norm, by iteratively reweighted least squares.

use rayon::prelude::*;

use super::graph::Quad;
use super::poisson::{Data, Weights};

/// How the iteration runs.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Least squares problems that are solved, the first with all weights 1.
    pub iterations: u32,
    /// Residual below which the norm is rounded off, in the second problem.
    pub epsilon: f32,
    /// What it is multiplied by from problem to problem.
    pub decay: f32,
}

impl Default for Options {
    fn default() -> Self {
        Self { iterations: 5, epsilon: 0.05, decay: 0.3 }
    }
}

/// Residuals of every least squares problem are brought down to this share: weights matter more than the last digits.
const TOLERANCE: f64 = 0.1;

/// Weights are at most one over this.
const LEAST: f32 = 1e-7;

/// Minimises Σ α |u - data| + Σ |Dx u - dx| + Σ |Dy u - dy|, where |.| is the length of a colour. Edges whose `kept`
/// is zero are left out.
pub fn solve(data: Data, kept: [&[f32]; 2], alpha: f32, options: Options) -> Vec<Quad> {
    let nodes = data.data.len();
    let mut u = data.data.to_vec();
    for k in 0..options.iterations {
        let epsilon = (options.epsilon * options.decay.powi(k as i32 - 1)).max(LEAST);
        let weight = |length: f32| if k == 0 { 1.0 } else { 1.0 / (length + epsilon) };
        let along = |axis: usize, step: usize| -> Vec<f32> {
            let residual = |i: usize| match u.get(i + step) {
                Some(next) => length(|c| next[c] - u[i][c] - data.edges[axis][i][c]),
                None => 0.0,
            };
            (0..nodes).into_par_iter().map(|i| kept[axis][i] * weight(residual(i))).collect()
        };
        let own = |i: usize| alpha * alpha * weight(alpha * length(|c| u[i][c] - data.data[i][c]));
        let weights = Weights {
            across: along(0, 1),
            down: along(1, data.width),
            screen: (0..nodes).into_par_iter().map(own).collect(),
        };
        u = weights.solver(data.width).solve(&weights.right(data), u, TOLERANCE).x;
    }
    u
}

/// Length of a colour.
fn length(value: impl Fn(usize) -> f32) -> f32 {
    (0..3).map(|c| value(c) * value(c)).sum::<f32>().sqrt()
}
