//! Times, samples and memory of a run, as one JSON object.

use std::path::Path;

use anyhow::Result;
use fluxion::adaptive::Pass;
use fluxion::render::RenderOutcome;
use schemars::JsonSchema;
use serde::Serialize;

use super::outputs::write_json;

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
        let film = &outcome.film;
        (self.samples, self.rejected) = (film.samples(), film.rejected());
        self.spp = (self.samples as f64 / (film.width * film.height) as f64).round() as u32;
    }

    /// Writes the object, with the peak memory as it is now.
    pub fn save(&mut self, path: &Path) -> Result<()> {
        self.peak_bytes = fluxion::bench::peak_bytes();
        write_json(path, self)
    }
}
