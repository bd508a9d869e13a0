//! Convex combinations of least quadratic cost.
//!
//! The weights w >= 0 with Σ w = 1 that minimise |Σ w_q u_q|² + Σ v_q w_q², for n vectors u_q of r numbers, r being
//! small. With y = w / (wᵀQw), the conditions of optimality read y_q = max(0, 1 - u_q·h) / v_q and h = Σ y_q u_q:
//! h minimises |h|² + Σ max(0, 1 - u_q·h)² / v_q, which is smooth, strictly convex, piecewise quadratic, and has r
//! unknowns instead of n. Newton's method with a line search ends after a few steps, exactly.

/// Most unknowns.
pub const RANK: usize = 15;

type Vector = [f64; RANK];

/// Steps are far fewer; this only bounds the work where rounding keeps the line search from settling.
const STEPS: usize = 60;

/// Computes the weights; `u` holds the vectors with zeros beyond their `rank` numbers. Every `v` is raised to a
/// billionth of the mean cost, which keeps the problem strictly convex.
pub fn nearest(u: &[Vector], v: &[f64], rank: usize, weights: &mut [f64]) {
    let cost = |q: usize| u[q].iter().map(|x| x * x).sum::<f64>() + v[q];
    let scale = (0..u.len()).map(cost).sum::<f64>() / u.len() as f64;
    if !(scale > 0.0 && scale.is_finite()) {
        weights.fill(1.0 / u.len() as f64);
        return;
    }
    // In units of the mean cost: h grows by the root of the scale.
    let root = scale.sqrt();
    let penalty = |q: usize| (v[q] / scale).max(1e-9);
    let slack = |q: usize, h: &Vector| 1.0 - (0..rank).map(|k| u[q][k] / root * h[k]).sum::<f64>();
    let value = |h: &Vector| {
        let loss = (0..u.len()).map(|q| slack(q, h).max(0.0).powi(2) / penalty(q)).sum::<f64>();
        loss + h.iter().map(|x| x * x).sum::<f64>()
    };
    let mut h = [0.0; RANK];
    let mut best = value(&h);
    for _ in 0..STEPS {
        let (mut matrix, mut right) = ([[0.0; RANK]; RANK], [0.0; RANK]);
        (0..rank).for_each(|k| matrix[k][k] = 1.0);
        for q in (0..u.len()).filter(|&q| slack(q, &h) > 0.0) {
            let share = 1.0 / penalty(q);
            for i in 0..rank {
                let x = u[q][i] / root * share;
                right[i] += x;
                (0..=i).for_each(|j| matrix[i][j] += x * u[q][j] / root);
            }
        }
        solve(&mut matrix, &mut right, rank);
        let step: Vector = std::array::from_fn(|k| right[k] - h[k]);
        let mut length = 1.0;
        let next = loop {
            let trial: Vector = std::array::from_fn(|k| h[k] + length * step[k]);
            let loss = value(&trial);
            if loss < best {
                break Some((trial, loss));
            }
            length *= 0.5;
            if length < 1e-6 {
                break None;
            }
        };
        let Some((trial, loss)) = next else { break };
        let done = best - loss <= 1e-13 * best;
        (h, best) = (trial, loss);
        if done {
            break;
        }
    }
    let mut total = 0.0;
    for (q, weight) in weights.iter_mut().enumerate() {
        *weight = slack(q, &h).max(0.0) / penalty(q);
        total += *weight;
    }
    weights.iter_mut().for_each(|weight| *weight /= total);
}

/// Solves in place by Cholesky's method; the lower triangle of a positive definite matrix is given.
fn solve(a: &mut [Vector; RANK], x: &mut Vector, rank: usize) {
    for i in 0..rank {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| a[i][k] * a[j][k]).sum();
            let rest = a[i][j] - known;
            a[i][j] = if i == j { rest.max(1e-300).sqrt() } else { rest / a[j][j] };
        }
        let known: f64 = (0..i).map(|k| a[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / a[i][i];
    }
    for i in (0..rank).rev() {
        let known: f64 = (i + 1..rank).map(|k| a[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / a[i][i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{combine, unit};

    fn problem(n: usize, rank: usize, seed: u64, noise: f64) -> (Vec<Vector>, Vec<f64>) {
        let random = |i: usize| f64::from(unit(combine(seed, i as u64)));
        let vector = |q: usize| std::array::from_fn(|k| if k < rank { random(q * 31 + k) - 0.4 } else { 0.0 });
        ((0..n).map(vector).collect(), (0..n).map(|q| noise * random(10_000 + q)).collect())
    }

    /// Half of the cost's gradient, and the cost.
    fn gradient(u: &[Vector], v: &[f64], w: &[f64]) -> (Vec<f64>, f64) {
        let sum: Vector = std::array::from_fn(|k| u.iter().zip(w).map(|(u, w)| u[k] * w).sum());
        let dot = |a: &Vector| a.iter().zip(&sum).map(|(a, b)| a * b).sum::<f64>();
        let g: Vec<f64> = (0..u.len()).map(|q| dot(&u[q]) + v[q] * w[q]).collect();
        let cost = g.iter().zip(w).map(|(g, w)| g * w).sum();
        (g, cost)
    }

    fn weights(u: &[Vector], v: &[f64], rank: usize) -> Vec<f64> {
        let mut w = vec![0.0; u.len()];
        nearest(u, v, rank, &mut w);
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12 && w.iter().all(|&w| w >= 0.0));
        w
    }

    #[test]
    fn the_conditions_of_optimality_hold() {
        for (seed, noise) in (0..40).flat_map(|seed| [(seed, 1e-4), (seed, 0.1), (seed, 10.0)]) {
            let (u, v) = problem(81, 15, seed, noise);
            let w = weights(&u, &v, 15);
            let (g, cost) = gradient(&u, &v, &w);
            for q in 0..81 {
                assert!(g[q] >= cost * (1.0 - 1e-6), "{seed}: {} under {cost}", g[q]);
                assert!(w[q] < 1e-12 || g[q] <= cost * (1.0 + 1e-6), "{seed}: {} over {cost}", g[q]);
            }
        }
    }

    #[test]
    fn no_set_of_supports_is_better() {
        for seed in 0..20 {
            let (u, v) = problem(6, 3, seed, 0.2);
            let (_, ours) = gradient(&u, &v, &weights(&u, &v, 3));
            let mut best = f64::INFINITY;
            for support in 1..64usize {
                let members: Vec<_> = (0..6).filter(|q| support >> q & 1 == 1).collect();
                // Weights of equal gradient on the support: Q z = 1.
                let mut a = [[0.0; RANK]; RANK];
                for (i, &p) in members.iter().enumerate() {
                    for (j, &q) in members.iter().enumerate() {
                        let dot: f64 = u[p].iter().zip(&u[q]).map(|(a, b)| a * b).sum();
                        a[i][j] = dot + if p == q { v[p] } else { 0.0 };
                    }
                }
                let mut z = [1.0; RANK];
                solve(&mut a, &mut z, members.len());
                if z[..members.len()].iter().all(|&z| z >= 0.0) {
                    best = best.min(1.0 / z[..members.len()].iter().sum::<f64>());
                }
            }
            assert!((ours / best - 1.0).abs() < 1e-6, "{seed}: {ours}, but {best} is possible");
        }
    }

    #[test]
    fn scale_and_order_do_not_matter_and_nothing_is_uniform() {
        let (u, v) = problem(49, 6, 3, 0.1);
        let w = weights(&u, &v, 6);
        for scale in [1e-6, 1e6] {
            let scaled: Vec<Vector> = u.iter().map(|u| u.map(|x| x * scale)).collect();
            let noise: Vec<f64> = v.iter().map(|v| v * scale * scale).collect();
            weights(&scaled, &noise, 6).iter().zip(&w).for_each(|(a, b)| assert!((a - b).abs() < 1e-7));
        }
        let turned: Vec<Vector> = u.iter().rev().copied().collect();
        let noise: Vec<f64> = v.iter().rev().copied().collect();
        weights(&turned, &noise, 6).iter().rev().zip(&w).for_each(|(a, b)| assert!((a - b).abs() < 1e-7));
        let nothing = weights(&[[0.0; RANK]; 9], &[0.0; 9], 6);
        nothing.iter().for_each(|w| assert!((w - 1.0 / 9.0).abs() < 1e-12));
        let mut loud = [1.0; 9];
        loud[4] = 1e12;
        assert!(weights(&[[0.0; RANK]; 9], &loud, 6)[4] < 1e-8);
    }
}
