//! `fluxion merge`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use fluxion::checkpoint;
use fluxion::error::Error;
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
    // In the order of their samples, so that the order of the arguments changes no bit.
    let mut films = Vec::new();
    for path in &args.films {
        films.push((checkpoint::load(path)?, path));
    }
    films.sort_by(|(a, _), (b, _)| a.origin.runs.cmp(&b.origin.runs));
    let mut films = films.into_iter();
    let Some((mut all, first)) = films.next() else { return Ok(ExitCode::SUCCESS) };
    for (film, path) in films {
        let refused = |why: String| Error::mismatch(path, format!("cannot be added to {}: it {why}", first.display()));
        all.merge(film).map_err(refused)?;
    }
    if args.output.extension().is_some_and(|extension| extension == "exr") {
        exr::save(&args.output, &all.develop())?;
    } else {
        checkpoint::save(&args.output, &all.origin, &all.outcome, None)?;
    }
    let spp = all.outcome.film.samples() as f64 / (all.origin.size.0 * all.origin.size.1) as f64;
    out!("{}: {spp:.1} samples per pixel of {} runs", args.output.display(), all.origin.runs.len())?;
    Ok(ExitCode::SUCCESS)
}
