//! Improvements and regressions between two sets of results.

use serde::Serialize;

use crate::bench::{Record, Results};

/// Two-sided quantiles of Student's t, for one degree of freedom on; more than these count as ten.
pub struct Quantiles([f64; 10]);

/// Quantiles at 1 %.
pub const CERTAIN: Quantiles = Quantiles([63.66, 9.92, 5.84, 4.60, 4.03, 3.71, 3.50, 3.36, 3.25, 3.17]);

/// Quantiles at 5 %.
pub const LIKELY: Quantiles = Quantiles([12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23]);

/// Changes of less than this are never certain: times differ from run to run.
const LEAST: f64 = 0.03;

/// A method's error on a scene within a budget, then and now.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Name of the scene.
    pub scene: String,
    /// The method with its parameters.
    pub method: String,
    /// Budget, as `5s` or `64spp`.
    pub budget: String,
    /// Error now over error then, geometric mean over the seeds.
    pub ratio: f64,
    /// -1 for better, 1 for worse, 0 for as it was or within the noise: of runs that are the same but for their seeds,
    /// one in a hundred is called better or worse.
    pub verdict: i32,
}

/// Compares, seed by seed, what both have on the same scenes and references and, where time is the budget, machines.
pub fn changes(now: &Results, then: &Results, metric: &str) -> Vec<Change> {
    let mut pairs: Vec<(&Record, Vec<f64>)> = Vec::new();
    for new in &now.records {
        let Some(old) = then.records.iter().find(|old| comparable(new, old)) else { continue };
        let (Some(a), Some(b)) = (new.error(metric), old.error(metric)) else { continue };
        let ratio = (a / b).ln();
        if !ratio.is_finite() {
            continue;
        }
        let same = |(one, _): &(&Record, Vec<f64>)| {
            (&one.scene, &one.method, &one.budget) == (&new.scene, &new.method, &new.budget)
        };
        match pairs.iter().position(same) {
            Some(at) => pairs[at].1.push(ratio),
            None => pairs.push((new, vec![ratio])),
        }
    }
    let change = |(record, ratios): (&Record, Vec<f64>)| {
        let (scene, method, budget) = (record.scene.clone(), record.method.clone(), record.budget.clone());
        let (mean, verdict) = judge(&ratios);
        Change { scene, method, budget, ratio: mean.exp(), verdict }
    };
    pairs.into_iter().map(change).collect()
}

fn comparable(new: &Record, old: &Record) -> bool {
    let key = |record: &Record| (record.scene.clone(), record.method.clone(), record.budget.clone(), record.seed);
    let measured = |record: &Record| (record.fingerprint.clone(), record.width, record.height, record.floor);
    let timed = !new.budget.ends_with("spp");
    key(new) == key(old) && measured(new) == measured(old) && (!timed || new.machine == old.machine)
}

/// Mean of logarithms of ratios, and whether it is certainly below or above zero.
fn judge(ratios: &[f64]) -> (f64, i32) {
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    let certain = mean.abs() > LEAST && differ(ratios, &CERTAIN);
    (mean, if certain { mean.signum() as i32 } else { 0 })
}

/// Whether the mean of values, such as logarithms of ratios, differs from zero by more than their noise.
pub fn differ(values: &[f64], quantiles: &Quantiles) -> bool {
    let n = values.len() as f64;
    let Some(freedom) = values.len().checked_sub(2) else { return false };
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    let noise = (squares / (n - 1.0) / n).sqrt();
    mean.abs() > quantiles.0[freedom.min(quantiles.0.len() - 1)] * noise
}
