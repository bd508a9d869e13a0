//! Improvements and regressions between two sets of results.

use serde::Serialize;

use crate::bench::{Record, Results};

/// Two-sided quantiles of Student's t at 1 %, for one degree of freedom on; more than these count as ten.
const CERTAIN: [f64; 10] = [63.66, 9.92, 5.84, 4.60, 4.03, 3.71, 3.50, 3.36, 3.25, 3.17];

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
        let (Some(a), Some(b)) = (new.metrics.get(metric), old.metrics.get(metric)) else { continue };
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
    let n = ratios.len() as f64;
    let mean = ratios.iter().sum::<f64>() / n;
    let Some(freedom) = ratios.len().checked_sub(2) else { return (mean, 0) };
    let squares: f64 = ratios.iter().map(|ratio| (ratio - mean) * (ratio - mean)).sum();
    let noise = (squares / (n - 1.0) / n).sqrt();
    let certain = mean.abs() > LEAST.max(CERTAIN[freedom.min(CERTAIN.len() - 1)] * noise);
    (mean, if certain { mean.signum() as i32 } else { 0 })
}
