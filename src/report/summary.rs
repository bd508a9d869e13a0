//! Figures over all scenes: how much better a method is than path tracing, and how fast it gets better.

use std::collections::BTreeMap;

use serde::Serialize;

use super::changes::{LIKELY, differ};
use crate::bench::{Record, Results};

/// The method that others are compared with.
pub const BASE: &str = "primal";

/// A method's error on a scene within a budget: all seeds.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Name of the scene.
    pub scene: String,
    /// The method with its parameters.
    pub method: String,
    /// Budget, as `5s` or `64spp`.
    pub budget: String,
    /// Seconds that were, mean over the seeds.
    pub seconds: f64,
    /// Samples per pixel, mean over the seeds.
    pub spp: f64,
    /// Error of every seed, in their order; of relMSE without the reference's own noise.
    pub errors: Vec<f64>,
}

impl Point {
    /// Whether it is on the same scene within the same budget.
    fn beside(&self, other: &Self) -> bool {
        self.scene == other.scene && self.budget == other.budget
    }

    /// Mean over the seeds.
    pub fn error(&self) -> f64 {
        self.errors.iter().sum::<f64>() / self.errors.len() as f64
    }

    /// Standard error of the mean over the seeds; none of a single seed.
    pub fn standard_error(&self) -> Option<f64> {
        let (n, mean) = (self.errors.len() as f64, self.error());
        let squares: f64 = self.errors.iter().map(|error| (error - mean).powi(2)).sum();
        (n > 1.0).then(|| (squares / (n - 1.0) / n).sqrt())
    }

    /// Whether its error is another than that of a point beside it: of methods that are alike one in twenty is.
    pub fn differs(&self, other: &Self) -> bool {
        let ratios: Vec<f64> = self.errors.iter().zip(&other.errors).map(|(a, b)| (a / b).ln()).collect();
        ratios.iter().all(|ratio| ratio.is_finite()) && differ(&ratios, &LIKELY)
    }
}

/// A method's figures.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The method with its parameters.
    pub method: String,
    /// Geometric mean of its error over path tracing's after the same time, or with the same samples if these are the
    /// budget; over those scenes and budgets that all methods have, so that it compares between methods.
    pub ratio: Option<f64>,
    /// Geometric mean over scenes of the time that path tracing would take, by its own line through its errors, for the
    /// error that the method has at its largest budget, over the method's time.
    pub speedup: Option<f64>,
    /// Median over scenes of the slope of error over time, both as logarithms; -1 halves the error in twice the time.
    pub slope: Option<f64>,
    /// Scenes and budgets where no other method has less error.
    pub wins: usize,
    /// Scenes and budgets where it was run.
    pub runs: usize,
}

/// The figures of one metric.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Every method, that with the least error first.
    pub rows: Vec<Row>,
    /// The records that are summarised.
    pub points: Vec<Point>,
}

impl Summary {
    /// Summarises a metric of the results.
    pub fn new(results: &Results, metric: &str) -> Self {
        let points = points(results, metric);
        let methods = each_once(points.iter().map(|point| point.method.as_str()));
        let everywhere = |point: &&Point| {
            let has = |method: &&str| points.iter().any(|other| other.method == **method && other.beside(point));
            methods.iter().all(has)
        };
        let common: Vec<&Point> = points.iter().filter(everywhere).collect();
        let mut rows: Vec<Row> = methods.iter().map(|method| row(&points, &common, method)).collect();
        let rank = |row: &Row| row.ratio.unwrap_or(f64::INFINITY);
        rows.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        Self { rows, points }
    }
}

/// Names in the order that they first come in.
pub(super) fn each_once<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut found = Vec::new();
    for name in names {
        if !found.contains(&name) {
            found.push(name);
        }
    }
    found
}

fn points(results: &Results, metric: &str) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::new();
    let mut counts: Vec<f64> = Vec::new();
    for record in &results.records {
        let Record { scene, method, budget, .. } = record;
        let Some(error) = record.error(metric) else { continue };
        let same = |point: &Point| point.scene == *scene && point.method == *method && point.budget == *budget;
        let at = points.iter().position(same).unwrap_or_else(|| {
            let (scene, method, budget) = (scene.clone(), method.clone(), budget.clone());
            points.push(Point { scene, method, budget, seconds: 0.0, spp: 0.0, errors: Vec::new() });
            counts.push(0.0);
            points.len() - 1
        });
        counts[at] += 1.0;
        let point = &mut points[at];
        point.seconds += (record.seconds.total - point.seconds) / counts[at];
        point.spp += (f64::from(record.spp) - point.spp) / counts[at];
        point.errors.push(error);
    }
    points
}

fn row(points: &[Point], common: &[&Point], method: &str) -> Row {
    let own: Vec<&Point> = points.iter().filter(|point| point.method == method).collect();
    let base = |scene: &str| {
        let base = points.iter().filter(|point| point.method == BASE && point.scene == scene);
        let mut base: Vec<_> = base.map(|point| (point.seconds.ln(), point.error().ln())).collect();
        base.sort_by(|a, b| a.0.total_cmp(&b.0));
        base
    };
    let ratios = common.iter().filter(|point| point.method == method).filter_map(|point| {
        let same = points.iter().find(|other| other.method == BASE && other.beside(point))?;
        let base = match point.budget.ends_with("spp") {
            true => same.error().ln(),
            false => interpolate(&base(&point.scene), point.seconds.ln()),
        };
        Some(point.error().ln() - base)
    });
    let mut scenes: BTreeMap<&str, Vec<&Point>> = BTreeMap::new();
    own.iter().for_each(|point| scenes.entry(&point.scene).or_default().push(point));
    let slopes = scenes.values().filter_map(|points| {
        let points: Vec<_> = points.iter().map(|point| (point.seconds.ln(), point.error().ln())).collect();
        line(&points).map(|(_, slope)| slope)
    });
    let speedups = scenes.iter().filter_map(|(scene, points)| {
        let last = points.iter().max_by(|a, b| a.seconds.total_cmp(&b.seconds))?;
        let (start, slope) = line(&base(scene)).filter(|(_, slope)| *slope < -0.1)?;
        Some((last.error().ln() - start) / slope - last.seconds.ln())
    });
    let best = |point: &&&Point| {
        let rivals = points.iter().filter(|rival| rival.beside(point));
        rivals.map(Point::error).fold(f64::INFINITY, f64::min) >= point.error()
    };
    Row {
        method: method.to_owned(),
        ratio: geometric_mean(ratios),
        speedup: geometric_mean(speedups),
        slope: median(slopes.collect()),
        wins: own.iter().filter(best).count(),
        runs: own.len(),
    }
}

/// The value at `x` on the lines between points that are sorted by `x`, and on the outer ones beyond. A single point
/// lies on a line of slope -1, as errors of independent samples do.
fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let next = points.partition_point(|point| point.0 < x).clamp(1, points.len().max(2) - 1);
    match (points.get(next - 1), points.get(next)) {
        (Some(a), Some(b)) if b.0 > a.0 => a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0),
        (Some(a), _) => a.1 - (x - a.0),
        _ => f64::NAN,
    }
}

/// The middle value, or the mean of the middle two.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let (low, high) = (values.get(values.len().checked_sub(1)? / 2)?, values.get(values.len() / 2)?);
    Some(0.5 * (low + high))
}

/// Geometric mean of the finite values; none if there are none.
fn geometric_mean(logarithms: impl Iterator<Item = f64>) -> Option<f64> {
    let all: Vec<f64> = logarithms.filter(|value| value.is_finite()).collect();
    let mean = (all.iter().sum::<f64>() / all.len() as f64).exp();
    Some(mean).filter(|mean| mean.is_finite())
}

/// Least squares line through points: value at zero, and slope. None without two different abscissae.
fn line(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 / n, y + point.1 / n));
    let (xx, xy) = points.iter().fold((0.0, 0.0), |(xx, xy), point| {
        let (x, y) = (point.0 - mx, point.1 - my);
        (xx + x * x, xy + x * y)
    });
    let slope = xy / xx;
    (xx > 1e-12 && slope.is_finite()).then_some((my - slope * mx, slope))
}

/// Errors of `scale / t^power` at 1, 2 and 4 seconds, with the seeds apart by a factor of 1.1 each way.
#[cfg(test)]
pub fn test_results(methods: &[(&str, f64, f64)]) -> Results {
    let mut results = Results::default();
    for (method, scale, power) in methods {
        for (k, t) in [1.0, 2.0, 4.0f64].into_iter().enumerate() {
            for seed in [1, 2] {
                let error = scale / t.powf(*power) * if seed == 1 { 0.9 } else { 1.1 };
                results.records.push(Record {
                    scene: "room".into(),
                    method: (*method).into(),
                    budget: format!("{}s", 1 << k),
                    seed,
                    width: 1,
                    height: 1,
                    fingerprint: String::new(),
                    spp: 1,
                    seconds: crate::bench::Seconds { total: t, ..crate::bench::Seconds::default() },
                    metrics: ["relmse", "smape"].map(|name| (name.to_owned(), error)).into(),
                    negative: 0.0,
                    rejected: 0,
                    peak_bytes: 0,
                    floor: None,
                    machine: String::new(),
                    version: String::new(),
                });
            }
        }
    }
    results
}

#[cfg(test)]
mod tests {
    use super::test_results as results;
    use super::*;

    #[test]
    fn figures_are_those_of_exact_power_laws() {
        let summary = Summary::new(&results(&[("primal", 1.0, 1.0), ("good", 0.1, 1.0), ("slow", 0.3, 0.5)]), "relmse");
        let row = |k: usize| &summary.rows[[2, 0, 1][k]];
        let close = |value: Option<f64>, expected: f64| (value.unwrap() - expected).abs() < 1e-9;
        assert!(close(row(0).ratio, 1.0) && close(row(0).slope, -1.0) && close(row(0).speedup, 1.0));
        assert!(close(row(1).ratio, 0.1) && close(row(1).slope, -1.0) && close(row(1).speedup, 10.0));
        // 0.3 sqrt(t) over path tracing: the geometric mean is at t = 2.
        assert!(close(row(2).ratio, 0.3 * 2f64.sqrt()) && close(row(2).slope, -0.5));
        assert!(close(row(2).speedup, 1.0 / (0.3 / 2.0) / 4.0));
        assert_eq!((row(0).wins, row(1).wins, row(2).wins), (0, 3, 0));
    }

    #[test]
    fn the_noise_of_references_is_taken_off() {
        let mut results = results(&[("primal", 1.0, 1.0)]);
        results.records.iter_mut().for_each(|record| record.floor = Some(0.3));
        let of = |results: &Results, metric: &str| results.records[4].error(metric);
        // 0.9 / 4 is below the noise: what is left is what is known of that.
        assert_eq!((of(&results, "relmse"), of(&results, "flip")), (Some(0.05 * 0.3), None));
        assert!((results.records[0].error("relmse").unwrap() - 0.6).abs() < 1e-12);
    }

    #[test]
    fn methods_are_ranked_by_what_all_of_them_have() {
        let mut uneven = results(&[("primal", 1.0, 1.0), ("late", 0.5, 1.0), ("steep", 1.0, 2.0)]);
        uneven.records.retain(|record| record.method != "late" || record.budget == "4s");
        let summary = Summary::new(&uneven, "relmse");
        let ratio = |method: &str| summary.rows.iter().find(|row| row.method == method).unwrap().ratio.unwrap();
        // At four seconds only, where the steep one has a quarter.
        assert!((ratio("steep") - 0.25).abs() < 1e-9 && (ratio("late") - 0.5).abs() < 1e-9);
    }

    #[test]
    fn path_tracing_is_taken_at_the_time_that_was_used() {
        let points = [(0.0, 0.0), (1.0, -1.0), (2.0, -3.0)];
        for (x, y) in [(0.5, -0.5), (1.5, -2.0), (-1.0, 1.0), (3.0, -5.0), (1.0, -1.0)] {
            assert!((interpolate(&points, x) - y).abs() < 1e-12, "{x}");
        }
        assert!((interpolate(&points[..1], 0.7) + 0.7).abs() < 1e-12);
        assert!(interpolate(&[], 0.7).is_nan());
        assert_eq!((median(vec![3.0, 1.0]), median(vec![])), (Some(2.0), None));
    }

    #[test]
    fn a_single_budget_has_no_slope() {
        let mut few = results(&[("primal", 1.0, 1.0)]);
        few.records.truncate(2);
        let summary = Summary::new(&few, "relmse");
        assert_eq!((summary.rows[0].slope, summary.rows[0].speedup), (None, None));
    }
}
