//! `fluxion merge`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use fluxion::checkpoint;
use fluxion::film::exr;

use super::outputs::Claims;
use super::terminal::out;

/// Options of `merge`.
#[derive(clap::Args)]
pub struct Args {
    /// Checkpoints of the same scene with other samples, by --seed or --first
    #[arg(required = true, num_args = 2.., value_name = "CHECKPOINT")]
    films: Vec<PathBuf>,
    /// Checkpoint of all samples to write; its layers if the name ends in .exr
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Adds up films.
pub fn run(args: &Args) -> Result<ExitCode> {
    let inputs: Vec<_> = args.films.iter().map(PathBuf::as_path).collect();
    let _claims = Claims::new(&[], &[&Some(args.output.clone())], &inputs)?;
    let is_frame = args.output.extension().is_some_and(|extension| extension == "exr");
    let merged = if is_frame {
        let (frame, merged) = checkpoint::develop(&args.films, &args.output)?;
        exr::save(&args.output, &frame)?;
        merged
    } else {
        checkpoint::merge(&args.films, &args.output)?
    };
    let spp = merged.samples as f64 / (merged.origin.size.0 * merged.origin.size.1) as f64;
    out!("{}: {spp:.1} samples per pixel of {} runs", args.output.display(), merged.origin.runs.len())?;
    Ok(ExitCode::SUCCESS)
}
