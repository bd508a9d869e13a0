//! `fluxion merge`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use fluxion::checkpoint;
use fluxion::error::Error;
use fluxion::film::exr;
use fluxion::reference::Reference;

use super::outputs::Claims;
use super::terminal::out;

/// Options of `merge`.
#[derive(clap::Args)]
pub struct Args {
    /// Checkpoints of the same scene with other samples, by --seed or --first; or references with other seeds. Of a single
    /// checkpoint the layers can be written
    #[arg(required = true, value_name = "CHECKPOINT")]
    films: Vec<PathBuf>,
    /// Checkpoint of all samples to write, or its layers if the name ends in .exr; the reference of all samples
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Adds up films or references.
pub fn run(args: &Args) -> Result<ExitCode> {
    let inputs: Vec<_> = args.films.iter().map(PathBuf::as_path).collect();
    let _claims = Claims::new(&[], &[&Some(args.output.clone())], &inputs)?;
    if is_reference(&args.films[0]) {
        return references(args);
    }
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

fn is_reference(path: &Path) -> bool {
    !checkpoint::is_one(path) && Reference::is_one(path).unwrap_or(false)
}

/// Adds up references.
fn references(args: &Args) -> Result<ExitCode> {
    let mut all = Reference::load(&args.films[0])?;
    for path in &args.films[1..] {
        all.add(&Reference::load(path)?).map_err(|why| Error::mismatch(path, why))?;
    }
    all.save(&args.output, false)?;
    out!("{}: {} spp of {} references", args.output.display(), all.spp, args.films.len())?;
    Ok(ExitCode::SUCCESS)
}
