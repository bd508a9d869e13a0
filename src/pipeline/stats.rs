//! Times, samples and memory of a run.

use schemars::JsonSchema;
use serde::Serialize;

use crate::adaptive::Pass;
use crate::render::RenderOutcome;

/// Wall-clock seconds of the stages.
#[derive(Clone, Copy, Debug, Default, Serialize, JsonSchema)]
pub struct Seconds {
    /// Reading the scene or the layers, building the hierarchy.
    pub load: f64,
    /// Tracing.
    pub render: f64,
    /// Sums to means.
    pub develop: f64,
    /// The method.
    pub reconstruct: f64,
    /// Writing all outputs.
    pub write: f64,
}

/// The object that `--json` writes.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct Stats {
    /// Time per stage.
    pub seconds: Seconds,
    /// Samples per pixel, the mean.
    pub spp: u32,
    /// Samples of all pixels.
    pub samples: u64,
    /// Largest resident memory of the process.
    pub peak_bytes: u64,
    /// Samples that were not finite.
    pub rejected: u64,
    /// The method with its parameters.
    pub method: String,
    /// Summary of the plan.
    pub plan: String,
    /// Neighbours that paths were shifted to, if not the cross.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub kernel: String,
    /// Passes of adaptive sampling.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub passes: Vec<Pass>,
}

impl Stats {
    /// Takes over times and counts of a render.
    pub fn rendered(&mut self, outcome: &RenderOutcome) {
        self.seconds.render = outcome.elapsed.as_secs_f64();
        (self.samples, self.rejected) = (outcome.film.samples(), outcome.film.rejected());
        self.spp = outcome.film.mean_spp().round() as u32;
    }
}

/// Forgets the largest memory so far, where the system can.
pub fn reset_peak() {
    // Best effort: without it later runs show the peak of earlier ones.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Largest resident set of the process since the last reset; 0 where the system does not say.
pub fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|rest| rest.trim().trim_end_matches("kB").trim().parse::<u64>().ok()).unwrap_or(0) * 1024
}
