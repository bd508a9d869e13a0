//! Stiff systems, against direct solutions in double precision and conditions of optimality.

use super::systems::System;
use super::{Case, Checks};
use crate::error::Result;
use crate::solve::poisson::{Weights, screened};
use crate::solve::{irls, simplex};
use crate::synthetic::random;

pub const CASES: &[Case] = &[
    Case { name: "solvers/screening", summary: "Poisson by cosines, screens from 1e-8 to 1e8", run: screening },
    Case { name: "solvers/weighted", summary: "weights of 1 to 1e16 side by side", run: weighted },
    Case {
        name: "solvers/islands",
        summary: "strongly bound regions between which all but nothing holds",
        run: islands,
    },
    Case { name: "solvers/reweighted", summary: "the L1 norm by weights that grow without bound", run: reweighted },
    Case {
        name: "solvers/combination",
        summary: "convex combinations: no cost, equal rows, scales of 1e±12",
        run: combination,
    },
];

fn screening(checks: &mut Checks) -> Result<()> {
    let system = System::new(12, 9, 1);
    let n = system.data.len();
    let data: Vec<_> = system.data.iter().map(|quad| f64::from(quad[0])).collect();
    let (dx, dy) = (system.grid(0), system.grid(1));
    for exponent in [-8, -4, 0, 4, 8] {
        let alpha = 10f64.powi(exponent);
        let u = screened(12, &data, &dx, &dy, alpha);
        // The mean is all that weak screens decide: it is compared apart.
        let mean = |u: &[f64]| u.iter().sum::<f64>() / n as f64;
        let exact = system.solve(&vec![alpha * alpha; n], &vec![1.0; system.edges.len()]);
        let (shift, largest) = (mean(&u) - mean(&exact), exact.iter().fold(1.0, |most: f64, x| most.max(x.abs())));
        let apart = u.iter().zip(&exact).map(|(u, exact)| (u - exact - shift).abs()).fold(0.0, f64::max);
        checks.add(format!("alpha {alpha:.0e}"), "largest error", apart / largest, 1e-9);
        checks.add(format!("alpha {alpha:.0e}"), "change of the mean", (mean(&u) - mean(&data)).abs(), 1e-9);
    }
    Ok(())
}

/// Solves in single precision; the excess over the least cost, as a share of what the data themselves cost.
fn excess(system: &System, weights: &Weights) -> f64 {
    let wide = |values: &[f32]| values.iter().map(|&value| f64::from(value)).collect::<Vec<_>>();
    let exact = system.solve(&wide(&weights.screen), &wide(&weights.edges));
    let found = weights.solver(&system.edges).solve(&weights.rhs(system.targets()), system.data.clone(), 1e-5).x;
    let found: Vec<_> = found.iter().map(|quad| f64::from(quad[0])).collect();
    let start: Vec<_> = system.data.iter().map(|quad| f64::from(quad[0])).collect();
    let [least, cost, before] = [&exact, &found, &start].map(|u| system.cost(weights, u, 2));
    (cost - least) / before
}

fn weighted(checks: &mut Checks) -> Result<()> {
    for (width, height) in [(8, 7), (24, 20)] {
        for exponent in [0, 4, 8, 12, 16] {
            let system = System::new(width, height, 2);
            let weight = |seed: u64, i: usize| 10f32.powf(exponent as f32 * (random(seed, i) - 0.5));
            let edges = &system.edges;
            let weights = Weights {
                edges: (0..edges.len()).map(|e| weight(11 + edges.kind(e) as u64, edges.ends(e)[0])).collect(),
                screen: (0..width * height).map(|i| weight(13, i)).collect(),
            };
            let subject = format!("{width}x{height}, 1e{exponent}");
            checks.add(subject, "excess cost, of that before", excess(&system, &weights), 1e-5);
        }
    }
    Ok(())
}

fn islands(checks: &mut Checks) -> Result<()> {
    let (width, height) = (24, 20);
    for exponent in [4, 8, 12, 16] {
        let system = System::new(width, height, 3);
        let (strong, weak) = (10f32.powi(exponent / 2), 10f32.powi(-exponent / 2));
        let at = |i: usize| (i % width, i / width);
        let crosses = |edge: usize| {
            let (x, y) = at(system.edges.ends(edge)[0]);
            if system.edges.kind(edge) == 0 { x % 8 == 7 } else { y % 5 == 4 }
        };
        let weights = Weights {
            edges: (0..system.edges.len()).map(|edge| if crosses(edge) { weak } else { strong }).collect(),
            // One pixel of each island determines its level.
            screen: (0..width * height)
                .map(|i| if at(i).0 % 8 == 3 && at(i).1 % 5 == 2 { 1.0 } else { weak })
                .collect(),
        };
        checks.add(format!("1e{exponent}"), "excess cost, of that before", excess(&system, &weights), 1e-6);
    }
    Ok(())
}

fn reweighted(checks: &mut Checks) -> Result<()> {
    for (seed, scale) in [(4, 1.0f32), (5, 1e-3), (6, 1e3)] {
        let mut system = System::new(14, 11, seed);
        let all = system.data.iter_mut().chain(&mut system.differences);
        all.for_each(|quad| quad[0] *= scale);
        // Rounded off at a share of the values, as the methods do by working on images of mean one.
        let options = irls::Options { iterations: 40, epsilon: 0.05 * scale, decay: 0.7 };
        let (n, alpha) = (system.data.len(), 0.3);
        let ones = vec![1.0; system.edges.len()];
        let found = irls::solve(system.targets(), &ones, alpha, options);
        let found: Vec<_> = found.iter().map(|quad| f64::from(quad[0])).collect();
        let unit = Weights { edges: ones, screen: vec![alpha; n] };
        let [cost, least] = [found, system.solve_l1(f64::from(alpha))].map(|u| system.cost(&unit, &u, 1));
        checks.add(format!("values of {scale:.0e}"), "excess cost", cost / least - 1.0, 1e-2);
    }
    Ok(())
}

fn combination(checks: &mut Checks) -> Result<()> {
    let (n, rank) = (60, 9);
    type Cost<'a> = &'a dyn Fn(usize) -> f64;
    type Row<'a> = &'a dyn Fn(usize, usize) -> f64;
    let costs: [(&str, Cost); 3] = [
        ("some cost", &|q| f64::from(random(7, q))),
        ("no cost", &|_| 0.0),
        ("costs of 1e-12 to 1e12", &|q| 10f64.powf(24.0 * f64::from(random(8, q)) - 12.0)),
    ];
    let rows: [(&str, Row); 4] = [
        ("rows around zero", &|q, k| f64::from(random(9, q * 31 + k)) - 0.4),
        ("equal rows", &|_, k| f64::from(random(9, k)) - 0.4),
        ("rows of one direction", &|q, k| (f64::from(random(10, q)) + 0.2) * (k as f64 - 3.0)),
        ("rows of zero", &|_, _| 0.0),
    ];
    for (of_rows, row) in &rows {
        for (of_costs, cost) in &costs {
            for scale in [1e-12, 1.0, 1e12] {
                let entry = |q: usize, k: usize| if k < rank { scale * row(q, k) } else { 0.0 };
                let u: Vec<[f64; simplex::RANK]> = (0..n).map(|q| std::array::from_fn(|k| entry(q, k))).collect();
                let v: Vec<f64> = (0..n).map(|q| scale * scale * cost(q)).collect();
                let mut w = vec![0.0; n];
                simplex::nearest(&u, &v, rank, &mut w);
                let sum: Vec<f64> = (0..rank).map(|k| (0..n).map(|q| w[q] * u[q][k]).sum()).collect();
                let slope = |q: usize| (0..rank).map(|k| u[q][k] * sum[k]).sum::<f64>() + v[q] * w[q];
                let cost = (0..n).map(|q| w[q] * slope(q)).sum::<f64>();
                // No combination costs less than twice the least slope less the cost of this one.
                let least = (0..n).map(slope).fold(f64::INFINITY, f64::min);
                let typical = (0..n).map(|q| u[q].iter().map(|x| x * x).sum::<f64>() + v[q]).sum::<f64>() / n as f64;
                let gap = if typical > 0.0 { (cost - least) / typical } else { 0.0 };
                let subject = format!("{of_rows}, {of_costs}, {scale:.0e}");
                checks.add(subject.clone(), "gap to the optimum, of the mean cost", gap, 1e-6);
                let outside = w.iter().map(|&w| -w).fold((w.iter().sum::<f64>() - 1.0).abs(), f64::max);
                checks.add(subject, "departure from the simplex", outside, 1e-9);
            }
        }
    }
    Ok(())
}
