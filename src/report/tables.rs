//! Tables of errors, all four measures side by side.

use serde::Serialize;

use super::summary::{Point, Row, Summary, each_once};
use crate::bench::{MEASURES, Results};

/// Noise of a reference above this share of a scene's smallest relMSE shows in the other measures, from which it cannot be taken off.
const CLEAN: f64 = 0.1;

/// Errors on a scene within a budget.
#[derive(Clone, Debug, Serialize)]
pub struct SceneErrors {
    /// Name of the scene.
    pub scene: String,
    /// Budget, as `5s` or `64spp`.
    pub budget: String,
    /// Expected relMSE of the reference itself, where it is known.
    pub floor: Option<f64>,
    /// Whether the reference's noise is a tenth of the smallest relMSE or less, so that the other measures mean something, too.
    pub clean: bool,
    /// Every method.
    pub rows: Vec<MethodErrors>,
}

/// Errors of a method.
#[derive(Clone, Debug, Serialize)]
pub struct MethodErrors {
    /// The method with its parameters.
    pub method: String,
    /// By [`MEASURES`]; none where an error is not finite, or the image is too small for the measure.
    pub errors: [Option<Entry>; 4],
}

/// An error over the seeds.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Entry {
    /// Mean over the seeds.
    pub mean: f64,
    /// Standard error of the mean, in shares of it; none of a single seed.
    pub noise: Option<f64>,
    /// Whether it does not differ significantly from the least error of the scene, and is another.
    pub alike: bool,
}

/// Summaries by [`MEASURES`].
pub fn summaries(results: &Results) -> [Summary; 4] {
    MEASURES.map(|(metric, _)| Summary::new(results, metric))
}

/// The errors of all scenes within a budget.
pub fn scene_errors(results: &Results, summaries: &[Summary; 4], budget: &str) -> Vec<SceneErrors> {
    let points = summaries[0].points.iter().filter(|point| point.budget == budget);
    let scenes = each_once(points.map(|point| point.scene.as_str()));
    scenes.into_iter().map(|scene| of_scene(results, summaries, scene, budget)).collect()
}

fn of_scene(results: &Results, summaries: &[Summary; 4], scene: &str, budget: &str) -> SceneErrors {
    let here = summaries.each_ref().map(|summary| {
        let inside = |point: &&Point| point.scene == scene && point.budget == budget;
        summary.points.iter().filter(inside).collect::<Vec<_>>()
    });
    let least = |points: &[&Point]| points.iter().map(|point| point.error()).fold(f64::INFINITY, f64::min);
    let floor = results.records.iter().find(|record| record.scene == scene).and_then(|record| record.floor);
    let rows = summaries[0].rows.iter().filter(|row| here[0].iter().any(|point| point.method == row.method));
    let rows = rows.map(|Row { method, .. }| MethodErrors {
        method: method.clone(),
        errors: here.each_ref().map(|points| entry(points, method)),
    });
    SceneErrors {
        scene: scene.to_owned(),
        budget: budget.to_owned(),
        floor,
        clean: floor.is_none_or(|floor| floor <= CLEAN * least(&here[0])),
        rows: rows.collect(),
    }
}

fn entry(points: &[&Point], method: &str) -> Option<Entry> {
    let own = points.iter().find(|point| point.method == method)?;
    let best = points.iter().min_by(|a, b| a.error().total_cmp(&b.error()))?;
    let alike = own.method != best.method && own.errors.len() > 1 && !own.differs(best);
    let noise = own.standard_error().map(|error| error / own.error());
    Some(Entry { mean: own.error(), noise, alike })
}

/// Errors over path tracing's as a Markdown table, with speed-up, slope and wins by relMSE.
pub fn ratios(summaries: &[Summary; 4]) -> String {
    let number = |value: Option<f64>, digits: usize| value.map_or("-".into(), |value| format!("{value:.digits$}"));
    let names = MEASURES.map(|(_, name)| name).join(" | ");
    let mut text = format!("| error over primal's | {names} | speed-up | slope | wins | of |\n|{}\n", "---|".repeat(9));
    for Row { method, speedup, slope, wins, runs, .. } in &summaries[0].rows {
        let ratio = |summary: &Summary| summary.rows.iter().find(|row| row.method == *method).and_then(|row| row.ratio);
        let ratios = summaries.each_ref().map(|summary| number(ratio(summary), 3)).join(" | ");
        let (speedup, slope) = (number(*speedup, 1), number(*slope, 2));
        text += &format!("| {method} | {ratios} | {speedup} | {slope} | {wins} | {runs} |\n");
    }
    text
}

/// Errors of all scenes as a Markdown table: means over the seeds, of relMSE with their standard errors in percent. `=` marks those
/// that do not differ significantly from the least of their scene. In parentheses are those that a reference's noise is a part of.
pub fn errors(scenes: &[SceneErrors]) -> String {
    let names = MEASURES.map(|(_, name)| name).join(" | ");
    let mut text = format!("| scene | method | {names} | floor |\n|{}\n", "---|".repeat(7));
    for SceneErrors { scene, floor, clean, rows, .. } in scenes {
        let floor = floor.map_or("-".into(), |floor| format!("{floor:.1e}"));
        for MethodErrors { method, errors: [relmse, others @ ..] } in rows {
            let noise = |entry: Entry| entry.noise.map_or(String::new(), |noise| format!(" ±{:.0} %", 100.0 * noise));
            let mark = |entry: Entry| if entry.alike { " =" } else { "" };
            let first = relmse.map_or("-".into(), |entry| format!("{:.2e}{}{}", entry.mean, noise(entry), mark(entry)));
            let other = |entry: Entry| match clean {
                true => format!("{:.4}{}", entry.mean, mark(entry)),
                false => format!("({:.4})", entry.mean),
            };
            let others = others.map(|entry| entry.map_or("-".into(), other)).join(" | ");
            text += &format!("| {scene} | {method} | {first} | {others} | {floor} |\n");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::summary::test_results;

    #[test]
    fn tables_have_the_four_measures_side_by_side() {
        let mut results = test_results(&[("primal", 1.0, 1.0), ("good", 0.1, 1.0)]);
        for record in &mut results.records {
            let likeness = if record.method == "good" { 0.9 } else { 0.6 };
            record.metrics.insert("ms_ssim".into(), likeness);
        }
        let summaries = summaries(&results);
        let text = ratios(&summaries);
        assert!(text.contains("| good | 0.100 | 0.100 | - | 0.250 | 10.0 | -1.00 | 3 | 3 |"), "{text}");
        let text = errors(&scene_errors(&results, &summaries, "4s"));
        assert!(text.contains("| room | good | 2.50e-2 ±10 % | 0.0250 | - | 0.1000 | - |"), "{text}");
    }

    #[test]
    fn errors_that_do_not_differ_are_marked() {
        let mut results = test_results(&[("primal", 1.0, 1.0), ("good", 0.1, 1.0), ("alike", 0.1, 1.0)]);
        for record in results.records.iter_mut().filter(|record| record.method == "alike") {
            let factor = if record.seed == 1 { 1.03 } else { 0.98 };
            record.metrics.values_mut().for_each(|error| *error *= factor);
        }
        let text = errors(&scene_errors(&results, &summaries(&results), "4s"));
        // By relMSE and SMAPE.
        assert_eq!(text.matches(" =").count(), 2, "{text}");
        let marked = text.lines().find(|line| line.contains(" =")).unwrap();
        assert!(marked.starts_with("| room | good") || marked.starts_with("| room | alike"), "{text}");
    }

    #[test]
    fn noise_of_references_is_taken_off_relmse_and_shown_around_the_others() {
        let mut results = test_results(&[("primal", 1.0, 1.0)]);
        results.records.iter_mut().for_each(|record| record.floor = Some(0.01));
        let text = |results: &Results| errors(&scene_errors(results, &summaries(results), "1s"));
        assert!(text(&results).contains("| 9.90e-1 ±10 % | 1.0000 |"), "{}", text(&results));
        results.records.iter_mut().for_each(|record| record.floor = Some(0.2));
        assert!(text(&results).contains("| 8.00e-1 ±13 % | (1.0000) |"), "{}", text(&results));
    }
}
