//! `fluxion reconstruct`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Result, anyhow};
use fluxion::checkpoint;
use fluxion::error::Error;
use fluxion::film::{Frame, Layer, exr};
use fluxion::reconstruct;

use super::method;
use super::outputs::Claims;
use super::stats::Stats;
use super::terminal::note;

/// Options of `reconstruct`.
#[derive(clap::Args)]
pub struct Args {
    /// EXR file written by `fluxion render --layers`, or by Mitsuba, Cycles or pbrt with auxiliary channels; or a checkpoint
    layers: PathBuf,
    /// Image to write, by its extension: exr, hdr, pfm, tiff, png or jpg; may be given several times
    #[arg(short, long, required = true, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Samples per pixel of a file that does not say
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// View layer to take, of a file of several
    #[arg(long, value_name = "NAME")]
    view_layer: Option<String>,
    #[command(flatten)]
    method: method::Args,
    /// Threads to work with (0: one per core)
    #[arg(long, default_value_t = 0, value_parser = super::parse_threads)]
    threads: usize,
    /// JSON file for times and memory; - is standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Show no progress
    #[arg(short, long)]
    quiet: bool,
}

/// The error that a layer is missing, with the methods that find all that they need.
fn with_others(error: anyhow::Error, frame: &Frame) -> anyhow::Error {
    let Some(Error::Missing { .. }) = error.downcast_ref() else { return error };
    anyhow!("{error}. Methods that work on this file: {}", reconstruct::possible(frame).join(", "))
}

/// Reads layers, reconstructs and writes.
pub fn run(args: &Args) -> Result<ExitCode> {
    super::use_threads(args.threads)?;
    let method = args.method.make()?;
    let mut stats = Stats { method: args.method.method.clone(), ..Stats::default() };
    let start = Instant::now();
    let mut frame = if checkpoint::is_one(&args.layers) {
        checkpoint::load(&args.layers)?.develop()
    } else {
        let reading = exr::Reading { spp: args.spp, view_layer: args.view_layer.as_deref() };
        let (frame, warning) = exr::load_other(&args.layers, reading)?;
        if let Some(warning) = warning {
            note!("warning: {warning}");
        }
        frame
    };
    let _claims = Claims::new(&args.output, &[&args.json], &[&args.layers])?;
    stats.seconds.load = start.elapsed().as_secs_f64();
    stats.spp = frame.provenance.spp.parse().unwrap_or(0);
    stats.plan.clone_from(&frame.provenance.plan);
    stats.kernel.clone_from(&frame.provenance.kernel);
    let sum = |layer| frame.get(layer).map_or(0.0, |image| image.data.iter().map(|&n| f64::from(n)).sum());
    (stats.samples, stats.rejected) = (sum(Layer::Samples) as u64, sum(Layer::Rejected) as u64);
    let solution = args.method.solve(method.as_ref(), &frame, args.quiet, &mut stats);
    let solution = solution.map_err(|error| with_others(error, &frame))?;
    frame.provenance.method.clone_from(&args.method.method);
    method::write((&args.method, method.as_ref(), None), &args.output, &solution, &frame, &mut stats)?;
    if let Some(path) = &args.json {
        stats.save(path)?;
    }
    Ok(ExitCode::SUCCESS)
}
