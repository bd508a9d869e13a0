//! What got better and what got worse between two sets of results.

use serde::Serialize;

use super::summary::Summary;
use crate::bench::Results;

/// Standard errors that a change must exceed to count.
const CERTAIN: f64 = 3.0;

/// Changes of less than this are never certain: times differ from run to run.
const LEAST: f64 = 0.03;

/// A method's error on a scene within a budget, then and now.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Name of the scene.
    pub scene: String,
    /// The method with its parameters.
    pub method: String,
    /// What was to be used up.
    pub budget: String,
    /// Error now over error then.
    pub ratio: f64,
    /// -1 for better, 1 for worse, 0 for as it was or within the noise of the seeds.
    pub verdict: i32,
}

/// Compares what both have.
pub fn changes(now: &Results, then: &Results, metric: &str) -> Vec<Change> {
    let (now, then) = (Summary::new(now, metric).points, Summary::new(then, metric).points);
    let pairs = now.iter().filter_map(|new| {
        let same = |old: &&super::summary::Point| {
            old.scene == new.scene && old.method == new.method && old.budget == new.budget
        };
        let old = then.iter().find(same)?;
        let ratio = new.error() / old.error();
        let noise = (relative_noise(&new.errors) + relative_noise(&old.errors)).sqrt();
        let certain = ratio.ln().abs() > LEAST.max(CERTAIN * noise);
        let verdict = if !certain || !ratio.is_finite() { 0 } else { ratio.ln().signum() as i32 };
        let (scene, method, budget) = (new.scene.clone(), new.method.clone(), new.budget.clone());
        Some(Change { scene, method, budget, ratio, verdict })
    });
    pairs.collect()
}

/// Squared standard error of the mean, over the square of the mean. One value might be anything.
fn relative_noise(errors: &[f64]) -> f64 {
    let n = errors.len() as f64;
    if errors.len() < 2 {
        return f64::INFINITY;
    }
    let mean = errors.iter().sum::<f64>() / n;
    let squares: f64 = errors.iter().map(|error| (error - mean) * (error - mean)).sum();
    squares / (n - 1.0) / n / (mean * mean).max(f64::MIN_POSITIVE)
}
