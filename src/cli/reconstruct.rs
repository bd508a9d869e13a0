//! `fluxion reconstruct`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Result, anyhow};
use fluxion::checkpoint;
use fluxion::error::Error;
use fluxion::film::{Frame, Layer, exr};
use fluxion::pipeline::{Outputs, Stats, peak_bytes};
use fluxion::reconstruct;

use super::host::watched;
use super::outputs::Claims;
use super::terminal::note;
use super::{json, method};

/// Options of `reconstruct`.
#[derive(clap::Args)]
pub struct Args {
    /// EXR file written by `fluxion render --layers`, or by Mitsuba, Cycles or pbrt with auxiliary channels; or a checkpoint
    layers: PathBuf,
    /// Image to write, by its extension: exr, hdr, pfm, tiff, png or jpg; may be given several times
    #[arg(short, long, required = true, value_name = "FILE", help_heading = "Output")]
    output: Vec<PathBuf>,
    /// Samples per pixel of a file that does not say
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// View layer to take, of a file of several
    #[arg(long, value_name = "NAME")]
    view_layer: Option<String>,
    #[command(flatten)]
    method: method::Args,
    #[command(flatten)]
    exposure: method::Exposure,
    #[command(flatten)]
    json: json::Args,
}

/// The error that a layer is missing, with the methods that find all that they need.
fn with_others(error: Error, frame: &Frame) -> anyhow::Error {
    let Error::Missing { .. } = error else { return error.into() };
    anyhow!("{error}. Methods that work on this file: {}", reconstruct::possible(frame).join(", "))
}

/// Reads layers, reconstructs and writes.
pub fn run(args: &Args) -> Result<ExitCode> {
    let method = args.method.recipe().make()?;
    args.method.make_folder()?;
    let loading = Instant::now();
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
    let _claims = Claims::new(&args.output, &[&args.json.file()], &[&args.layers])?;
    let mut stats = of_frame(&frame, &method.name);
    stats.seconds.load = loading.elapsed().as_secs_f64();
    let solution = watched(|host| method.solve(&frame, host, &mut stats));
    let solution = solution.map_err(|error| with_others(error, &frame))?;
    frame.provenance.method.clone_from(&method.name);
    let (images, exposure, notes) = (args.output.clone(), args.exposure.exposure, args.method.notes.clone());
    let outputs = Outputs { images, exposure, notes, ..Outputs::default() };
    outputs.write_image(&method, (&frame, &solution), None, &mut stats)?;
    stats.peak_bytes = peak_bytes();
    args.json.write(&stats)?;
    Ok(ExitCode::SUCCESS)
}

/// Everything that a frame says of the render that it is from.
fn of_frame(frame: &Frame, method: &str) -> Stats {
    let sum = |layer| frame.get(layer).map_or(0.0, |image| image.data.iter().map(|&n| f64::from(n)).sum());
    Stats {
        spp: frame.provenance.spp.parse().unwrap_or(0),
        samples: sum(Layer::Samples) as u64,
        rejected: sum(Layer::Rejected) as u64,
        method: method.to_owned(),
        plan: frame.provenance.plan.clone(),
        kernel: frame.provenance.kernel.clone(),
        ..Stats::default()
    }
}
