//! `fluxion reconstruct`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Result;
use fluxion::checkpoint;
use fluxion::film::{Layer, exr};

use super::method;
use super::outputs::Claims;
use super::stats::Stats;

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

/// Reads layers, reconstructs and writes.
pub fn run(args: &Args) -> Result<ExitCode> {
    super::use_threads(args.threads)?;
    let method = args.method.make()?;
    let mut stats = Stats { method: args.method.method.clone(), ..Stats::default() };
    let start = Instant::now();
    let mut frame = if checkpoint::is_one(&args.layers) {
        checkpoint::load(&args.layers)?.develop()
    } else {
        exr::load_counted(&args.layers, args.spp)?
    };
    let _claims = Claims::new(&args.output, &[&args.json], &[&args.layers])?;
    stats.seconds.load = start.elapsed().as_secs_f64();
    stats.spp = frame.provenance.spp.parse().unwrap_or(0);
    stats.plan.clone_from(&frame.provenance.plan);
    stats.kernel.clone_from(&frame.provenance.kernel);
    let sum = |layer| frame.get(layer).map_or(0.0, |image| image.data.iter().map(|&n| f64::from(n)).sum());
    (stats.samples, stats.rejected) = (sum(Layer::Samples) as u64, sum(Layer::Rejected) as u64);
    let solution = args.method.solve(method.as_ref(), &frame, args.quiet, &mut stats)?;
    frame.provenance.method.clone_from(&args.method.method);
    method::write((&args.method, method.as_ref()), &args.output, &solution, &frame, &mut stats)?;
    if let Some(path) = &args.json {
        stats.save(path)?;
    }
    Ok(ExitCode::SUCCESS)
}
