//! Records of runs, and files of them.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Wall-clock seconds of the stages of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Seconds {
    /// Reading the scene and building the hierarchy, once for all runs; not part of the total.
    pub load: f64,
    /// Tracing.
    pub render: f64,
    /// Sums to means.
    pub develop: f64,
    /// The method.
    pub reconstruct: f64,
    /// Render, develop and reconstruct.
    pub total: f64,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Record {
    /// Name of the scene.
    pub scene: String,
    /// The method with its parameters.
    pub method: String,
    /// Budget: `5s` or `64spp`.
    pub budget: String,
    /// Number of the seed.
    pub seed: u64,
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// The scene's fingerprint.
    pub fingerprint: String,
    /// Samples per pixel that were taken.
    pub spp: u32,
    /// Time of the stages.
    pub seconds: Seconds,
    /// Every metric by its name, as far as it is finite.
    pub metrics: BTreeMap<String, f64>,
    /// Share of the image's values below zero.
    pub negative: f64,
    /// Samples that were not finite.
    pub rejected: u64,
    /// Largest resident memory of the process during the run.
    pub peak_bytes: u64,
    /// Expected relMSE of the reference itself, where it is known.
    pub floor: Option<f64>,
    /// Processor, and threads that were used.
    pub machine: String,
    /// Version of Fluxion.
    pub version: String,
}

/// The four measures of an error, keys of metrics with the names of the errors. All errors are zero for the reference itself.
pub const MEASURES: [(&str, &str); 4] =
    [("relmse", "relMSE"), ("smape", "SMAPE"), ("flip", "FLIP"), ("ms_ssim", "1 - MS-SSIM")];

/// The share of a reference's own noise that is still there after it has been taken off: how well the noise is known.
const KNOWN: f64 = 0.05;

impl Record {
    /// The error by a metric; that by MS-SSIM is what it lacks to one. The reference's own noise is taken off where it adds to the
    /// error, which is of relMSE: with the halves A and B of a reference R this leaves the mean of
    /// (I - A)(I - B) / (R² + 0.01), which is without bias. It is at least 5 % of that noise, below which nothing is known.
    pub fn error(&self, metric: &str) -> Option<f64> {
        let measured = *self.metrics.get(metric)?;
        Some(match self.floor {
            Some(floor) if metric == "relmse" => (measured - floor).max(KNOWN * floor),
            _ if metric == "ms_ssim" => 1.0 - measured,
            _ => measured,
        })
    }
}

/// A run that was not worth starting, or failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftOut {
    /// Name of the scene.
    pub scene: String,
    /// The method with its parameters.
    pub method: String,
    /// Budget: `5s` or `64spp`.
    pub budget: String,
    /// Why.
    pub reason: String,
}

/// All runs so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Results {
    /// Runs that were made.
    pub records: Vec<Record>,
    /// Runs that were left out.
    pub left_out: Vec<LeftOut>,
}

impl Results {
    /// Reads a file that [`Results::json`] was written to.
    pub fn load(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|error| Error::io(path, error))?;
        serde_json::from_str(&text)
            .map_err(|error| Error::io(path, format!("is no file of results ({error}): move it away")))
    }

    /// All of it as JSON.
    pub fn json(&self) -> Result<String> {
        serde_json::to_string_pretty(self).map_err(|error| Error::backend("json", error))
    }

    /// One line for every record, with names above.
    pub fn csv(&self) -> Result<String> {
        let failed = |error: csv::Error| Error::backend("csv", error);
        let mut writer = csv::Writer::from_writer(Vec::new());
        let fixed = ["scene", "method", "budget", "seed", "width", "height", "spp"];
        let seconds = ["load_s", "render_s", "develop_s", "reconstruct_s", "total_s"];
        let names: Vec<&str> = crate::metrics::METRICS.iter().map(|metric| metric.id).collect();
        let rest = ["negative", "rejected", "peak_bytes", "floor", "machine", "version"];
        let header = fixed.iter().chain(&seconds).chain(&names).chain(&rest);
        writer.write_record(header).map_err(failed)?;
        for record in &self.records {
            let Record { scene, method, budget, seed, width, height, spp, seconds, .. } = record;
            let Seconds { load, render, develop, reconstruct, total } = *seconds;
            let mut row = vec![scene.clone(), method.clone(), budget.clone(), seed.to_string(), width.to_string()];
            row.extend([height.to_string(), spp.to_string()]);
            row.extend([load, render, develop, reconstruct, total].map(|seconds| format!("{seconds:.4}")));
            row.extend(names.iter().map(|&name| record.metrics.get(name).map_or(String::new(), f64::to_string)));
            row.extend([record.negative.to_string(), record.rejected.to_string(), record.peak_bytes.to_string()]);
            row.push(record.floor.map_or(String::new(), |floor| floor.to_string()));
            row.extend([record.machine.clone(), record.version.clone()]);
            writer.write_record(&row).map_err(failed)?;
        }
        let bytes = writer.into_inner().map_err(|error| Error::backend("csv", error))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}

/// The processor and the number of threads in use.
pub fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("model name"));
    let name = line.map_or("unknown processor", |rest| rest.trim_start_matches([' ', '\t', ':']).trim());
    format!("{name}, {} threads", rayon::current_num_threads())
}
