//! Screened Poisson reconstruction in the L1 norm (Kettunen et al. 2015): like `l2`, but a difference that is far off
//! counts by its size and not by its square, so that outliers do not spread. The result is like a median: biased, and
//! consistent.

use super::common::problem::Problem;
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Needs};
use crate::solve::irls;

/// `l1`.
pub const METHOD: Method = Method {
    id: "l1",
    summary: "screened Poisson reconstruction that outliers among the differences do not spread in; consistent",
    traits: Traits::POISSON,
    parameters: &[
        Parameter { name: "alpha", default: "0.2", summary: "weight of the colour against the differences, > 0" },
        Parameter {
            name: "iterations",
            default: "5",
            summary: "least squares problems, 1 to 64, each weighted by the residuals of the one before",
        },
        Parameter {
            name: "epsilon",
            default: "0.05",
            summary: "residual below which the norm is smoothed in the first of them, over the typical luminance",
        },
        Parameter { name: "decay", default: "0.3", summary: "factor of epsilon from one to the next" },
    ],
    make,
};

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 550;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    Ok(Box::new(L1 {
        alpha: parameters.get("alpha", "a number in [1e-3, 1e3]", |alpha| (1e-3..=1e3).contains(alpha))?,
        options: irls::Options {
            iterations: parameters.get("iterations", "a number from 1 to 64", |n| (1..=64).contains(n))?,
            epsilon: parameters.get("epsilon", "a number in [1e-6, 1]", |epsilon| (1e-6..=1.0).contains(epsilon))?,
            decay: parameters.get("decay", "a number in [0.1, 1]", |decay| (0.1..=1.0).contains(decay))?,
        },
    }))
}

/// The solver with its parameters.
pub struct L1 {
    alpha: f32,
    options: irls::Options,
}

impl Default for L1 {
    /// The parameters of `l1`.
    fn default() -> Self {
        Self { alpha: 0.2, options: irls::Options { iterations: 5, epsilon: 0.05, decay: 0.3 } }
    }
}

impl Reconstruction for L1 {
    fn needs(&self) -> Needs {
        Needs::EDGES
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let problem = Problem::new(frame, context, (METHOD.id, BYTES))?;
        let solution = irls::solve(problem.targets(), &vec![1.0; problem.edges.len()], self.alpha, self.options);
        Ok(Solution { image: problem.inputs.image(&solution), alpha: None, error: None, notes: Vec::new() })
    }
}
