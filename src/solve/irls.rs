//! Screened Poisson reconstruction in the L1 norm, by iteratively reweighted least squares.

use rayon::prelude::*;

use super::graph::Quad;
use super::poisson::{Targets, Weights};

/// Parameters of the iteration.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Least squares problems that are solved, the first with all weights 1.
    pub iterations: u32,
    /// Residual below which the norm is smoothed, in the second problem.
    pub epsilon: f32,
    /// Factor of epsilon from one problem to the next.
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

/// Minimises Σ α |u - data| + Σ kept |u(higher) - u(lower) - difference|, where |.| is the length of a colour and `kept`
/// is one for every edge that counts, or zero.
pub fn solve(targets: Targets, kept: &[f32], alpha: f32, options: Options) -> Vec<Quad> {
    let Targets { edges, data, differences } = targets;
    let mut u = data.to_vec();
    for k in 0..options.iterations {
        let epsilon = (options.epsilon * options.decay.powi(k as i32 - 1)).max(LEAST);
        let weight = |length: f32| if k == 0 { 1.0 } else { 1.0 / (length + epsilon) };
        let of_edge = |edge: usize| {
            let [lower, higher] = edges.ends(edge);
            kept[edge] * weight(length(|c| u[higher][c] - u[lower][c] - differences[edge][c]))
        };
        let of_pixel = |i: usize| alpha * alpha * weight(alpha * length(|c| u[i][c] - data[i][c]));
        let weights = Weights {
            edges: (0..edges.len()).into_par_iter().map(of_edge).collect(),
            screen: (0..data.len()).into_par_iter().map(of_pixel).collect(),
        };
        u = weights.solver(edges).solve(&weights.rhs(targets), u, TOLERANCE).x;
    }
    u
}

/// Length of a colour.
fn length(value: impl Fn(usize) -> f32) -> f32 {
    (0..3).map(|c| value(c) * value(c)).sum::<f32>().sqrt()
}
