//! `fluxion schema`: JSON Schemas of everything that is written as JSON, made from the types that are written.

use std::process::ExitCode;

use anyhow::Result;
use fluxion::bench::Results;
use fluxion::dataset::Manifest;
use fluxion::job::{Job, Status};
use fluxion::metrics::METRICS;
use fluxion::output::samples::Description;
use fluxion::pipeline::Stats;
use fluxion::report::stress::Row;
use schemars::{Schema, json_schema, schema_for};

use super::compare::ALPHA;
use super::progress::Line;
use super::terminal::out;

/// Kind of JSON.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum Kind {
    /// Object of `render --json` and `reconstruct --json`.
    Render,
    /// Object of `compare --json`, of one image.
    Compare,
    /// File results.json of `bench`.
    Bench,
    /// List of `stress --json`.
    Stress,
    /// File job.json of `job plan`.
    Job,
    /// Object of `job status --json`.
    Status,
    /// File NAME.json of `dataset`.
    Dataset,
    /// File samples.json of `render --samples`.
    Samples,
    /// Lines of `--progress json`.
    Progress,
}

/// Prints a schema.
pub fn run(kind: Kind) -> Result<ExitCode> {
    let schema = match kind {
        Kind::Render => schema_for!(Stats),
        Kind::Compare => of_compare(),
        Kind::Bench => schema_for!(Results),
        Kind::Stress => schema_for!(Vec<Row>),
        Kind::Job => schema_for!(Job),
        Kind::Status => schema_for!(Status),
        Kind::Dataset => schema_for!(Manifest),
        Kind::Samples => schema_for!(Description),
        Kind::Progress => schema_for!(Line),
    };
    out!("{}", serde_json::to_string_pretty(&schema)?)?;
    Ok(ExitCode::SUCCESS)
}

/// A figure by every metric.
fn of_compare() -> Schema {
    let figure = |what: &str| serde_json::json!({"type": "number", "description": what});
    let mut properties: serde_json::Map<_, _> =
        METRICS.iter().map(|metric| (metric.id.to_owned(), figure(metric.summary))).collect();
    let required: Vec<_> = METRICS.iter().map(|metric| metric.id).collect();
    properties.insert(ALPHA.0.into(), figure(ALPHA.1));
    properties.insert("image".into(), serde_json::json!({"type": "string", "description": "the file, of several"}));
    json_schema!({"title": "Figures", "type": "object", "properties": properties, "required": required})
}
