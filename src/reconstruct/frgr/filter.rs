//! The gradient-guided filter: every pixel becomes a convex combination of the colours around it, with weights of
//! least expected error (Yan et al. 2024, section 3.3).
//!
//! The weights w of a window minimise Σ_t weight_t |Σ_q w_q (value_t(q) - target_t)|² + Σ_q w_q² penalty(q). The first
//! term's value is the enhanced image and its target the same image at the centre: the bias that gradients predict.
//! The penalty is the variance.

use std::borrow::Cow;

use crate::image::planes::{PlaneTile, Planes};
use crate::math::lanes::Lanes;
use crate::solve::simplex::{RANK, nearest};

/// Sweeps of the iterative solver.
const SWEEPS: usize = 3;

/// Most terms.
pub const TERMS: usize = RANK / 3;

/// Something of three channels that the weighted mean should hit.
pub struct Term<'a> {
    /// Values that are averaged.
    pub value: Cow<'a, Planes>,
    /// Value at the centre that the mean should have.
    pub target: &'a Planes,
    /// How much that counts.
    pub weight: f32,
}

/// Solver of the objective.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// Three sweeps of exact line searches towards each pixel in turn, as the authors have it. Stopping early keeps
    /// weights from fitting the noise.
    Sweeps,
    /// The minimum.
    Exact,
}

impl std::str::FromStr for Solver {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        match text {
            "sweeps" => Ok(Self::Sweeps),
            "exact" => Ok(Self::Exact),
            _ => Err(()),
        }
    }
}

/// A filter's inputs.
pub struct FilterProblem<'a> {
    /// The sampled colour.
    pub color: &'a Planes,
    /// Its variance.
    pub variance: &'a Planes,
    /// Cost of a squared weight.
    pub penalty: &'a Planes,
    /// One to [`TERMS`] terms of the objective.
    pub terms: Vec<Term<'a>>,
    /// Radius of the window.
    pub radius: usize,
    /// How it is solved.
    pub solver: Solver,
}

impl FilterProblem<'_> {
    /// The filtered colour and its variance.
    pub fn solve(&self) -> [Planes; 2] {
        let planes = Planes::from_tiles(self.color.width, self.color.height, 6, |tile| match self.solver {
            Solver::Sweeps => sweep_tile(self, tile),
            Solver::Exact => exact_tile(self, tile),
        });
        [planes.part(0, 3), planes.part(3, 3)]
    }

    /// Pixels of the window around one.
    #[inline(always)]
    fn window(&self, (x, y): (isize, isize)) -> impl Iterator<Item = (isize, isize)> + use<> {
        let r = self.radius as isize;
        (-r..=r).flat_map(move |dy| (-r..=r).map(move |dx| (x + dx, y + dy)))
    }
}

fn exact_tile(problem: &FilterProblem, tile: PlaneTile) -> Vec<f32> {
    let pixels = tile.width * tile.height;
    let mut out = vec![0.0; 6 * pixels];
    let size = (2 * problem.radius + 1).pow(2);
    let (mut vectors, mut penalties, mut weights) = (vec![[0.0; RANK]; size], vec![0.0; size], vec![0.0; size]);
    for i in 0..pixels {
        let at = ((tile.x + i % tile.width) as isize, (tile.y + i / tile.width) as isize);
        for (k, q) in problem.window(at).enumerate() {
            for (t, term) in problem.terms.iter().enumerate() {
                let root = f64::from(term.weight).sqrt();
                for c in 0..3 {
                    let difference = term.value.at(c, q.0, q.1) - term.target.at(c, at.0, at.1);
                    vectors[k][3 * t + c] = root * f64::from(difference);
                }
            }
            penalties[k] = f64::from(problem.penalty.at(0, q.0, q.1));
        }
        nearest(&vectors, &penalties, 3 * problem.terms.len(), &mut weights);
        for c in 0..3 {
            let (mut mean, mut variance) = (0.0, 0.0);
            for (weight, q) in weights.iter().zip(problem.window(at)) {
                mean += weight * f64::from(problem.color.at(c, q.0, q.1));
                variance += weight * weight * f64::from(problem.variance.at(c, q.0, q.1));
            }
            (out[c * pixels + i], out[(3 + c) * pixels + i]) = (mean as f32, variance as f32);
        }
    }
    out
}

vectorized! {
    fn sweep_tile(problem: &FilterProblem, tile: PlaneTile) -> Vec<f32> {
        let mut out = vec![0.0; 6 * tile.width * tile.height];
        let mut weights = vec![Lanes::ZERO; (2 * problem.radius + 1).pow(2)];
        for (x, y) in tile.blocks() {
            let at = ((tile.x + x) as isize, (tile.y + y) as isize);
            // The number of terms is known to the compiler, so that their sums stay in registers.
            let planes = match problem.terms.len() {
                1 => Sweeps::<1>::new(problem, at, &mut weights).run(),
                2 => Sweeps::<2>::new(problem, at, &mut weights).run(),
                3 => Sweeps::<3>::new(problem, at, &mut weights).run(),
                4 => Sweeps::<4>::new(problem, at, &mut weights).run(),
                _ => Sweeps::<TERMS>::new(problem, at, &mut weights).run(),
            };
            planes.into_iter().enumerate().for_each(|(c, values)| tile.put(&mut out, c, x, y, values));
        }
        out
    }
}

/// The sweeps of [`LANES`] pixels. A step from weights w towards pixel q changes Σ w u and Σ v w² only along u_q and
/// v_q w_q, so it takes as many operations as there are terms, whatever the size of the window.
struct Sweeps<'a, const T: usize> {
    problem: &'a FilterProblem<'a>,
    at: (isize, isize),
    targets: [[Lanes; 3]; T],
    roots: [Lanes; T],
    /// Weights over `scale`.
    weights: &'a mut [Lanes],
    scale: Lanes,
    /// Σ w u, and Σ v w².
    sums: [[Lanes; 3]; T],
    cost: Lanes,
}

impl<'a, const T: usize> Sweeps<'a, T> {
    #[inline(always)]
    fn new(problem: &'a FilterProblem, at: (isize, isize), weights: &'a mut [Lanes]) -> Self {
        let target = |t: usize, c: usize| problem.terms[t].target.lanes(c, at.0, at.1);
        let targets = std::array::from_fn(|t| [target(t, 0), target(t, 1), target(t, 2)]);
        let roots = std::array::from_fn(|t| Lanes::splat(problem.terms[t].weight.sqrt()));
        let sums = [[Lanes::ZERO; 3]; T];
        Self { problem, at, targets, roots, weights, scale: Lanes::splat(1.0), sums, cost: Lanes::ZERO }
    }

    #[inline(always)]
    fn run(mut self) -> [Lanes; 6] {
        self.start();
        for _ in 0..SWEEPS {
            self.sweep();
        }
        let total = self.weights.iter().fold(Lanes::ZERO, |sum, weight| sum + *weight);
        let share = Lanes::splat(1.0) / total;
        let mut result = [Lanes::ZERO; 6];
        for (weight, q) in self.weights.iter().zip(self.problem.window(self.at)) {
            let weight = *weight * share;
            for c in 0..3 {
                result[c] += weight * self.problem.color.lanes(c, q.0, q.1);
                result[3 + c] += weight * weight * self.problem.variance.lanes(c, q.0, q.1);
            }
        }
        result
    }

    /// Value of term `t` at q less its target.
    #[inline(always)]
    fn difference(&self, t: usize, c: usize, q: (isize, isize)) -> Lanes {
        self.problem.terms[t].value.lanes(c, q.0, q.1) - self.targets[t][c]
    }

    #[inline(always)]
    fn penalty(&self, q: (isize, isize)) -> Lanes {
        self.problem.penalty.lanes(0, q.0, q.1)
    }

    /// Weights by each pixel's own cost, and their sums.
    #[inline(always)]
    fn start(&mut self) {
        let mut total = Lanes::ZERO;
        for (k, q) in self.problem.window(self.at).enumerate() {
            let penalty = self.penalty(q);
            let mut cost = penalty + Lanes::splat(0.1);
            let mut differences = [[Lanes::ZERO; 3]; T];
            for (t, c) in (0..T).flat_map(|t| [(t, 0), (t, 1), (t, 2)]) {
                let difference = self.difference(t, c, q);
                cost += difference * difference;
                differences[t][c] = difference;
            }
            let weight = Lanes::splat(1.0) / cost.sqrt();
            self.weights[k] = weight;
            total += weight;
            self.cost += weight * weight * penalty;
            for (t, c) in (0..T).flat_map(|t| [(t, 0), (t, 1), (t, 2)]) {
                self.sums[t][c] += weight * differences[t][c];
            }
        }
        self.scale = Lanes::splat(1.0) / total;
        self.cost = self.cost * self.scale * self.scale;
        for (t, c) in (0..T).flat_map(|t| [(t, 0), (t, 1), (t, 2)]) {
            self.sums[t][c] = self.sums[t][c] * self.roots[t] * self.scale;
        }
    }

    /// One step towards each pixel of the window, as far as the objective falls.
    #[inline(always)]
    fn sweep(&mut self) {
        let one = Lanes::splat(1.0);
        for (k, q) in self.problem.window(self.at).enumerate() {
            let v = self.penalty(q);
            let mut step = [[Lanes::ZERO; 3]; T];
            let (mut length, mut slope) = (Lanes::ZERO, Lanes::ZERO);
            for (t, c) in (0..T).flat_map(|t| [(t, 0), (t, 1), (t, 2)]) {
                let d = self.roots[t] * self.difference(t, c, q) - self.sums[t][c];
                length += d * d;
                slope += self.sums[t][c] * d;
                step[t][c] = d;
            }
            let vw = v * self.weights[k] * self.scale;
            let curve = length + v - vw - vw + self.cost;
            // All the way would leave nothing to scale; where nothing curves the quotient is NaN: no step.
            let lambda = ((self.cost - slope - vw) / curve).max(Lanes::ZERO).min(Lanes::splat(0.999));
            let keep = one - lambda;
            self.cost = keep * keep * self.cost + lambda * (keep + keep) * vw + lambda * lambda * v;
            self.scale = self.scale * keep;
            self.weights[k] += lambda / self.scale;
            for (t, c) in (0..T).flat_map(|t| [(t, 0), (t, 1), (t, 2)]) {
                self.sums[t][c] += lambda * step[t][c];
            }
            // Before the scale gets too small for the weights over it.
            if k % 9 == 8 && self.scale.0.iter().any(|&scale| scale < 1e-9) {
                self.weights.iter_mut().for_each(|weight| *weight = *weight * self.scale);
                self.scale = one;
            }
        }
    }
}
