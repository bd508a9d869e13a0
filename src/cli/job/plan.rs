//! `fluxion job plan`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use fluxion::adaptive::ALLOCATORS;
use fluxion::error::Error;

use super::description::{Job, Settings};
use super::schedulers;
use crate::cli::render;
use crate::cli::terminal::out;

/// Options of `job plan`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene files
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Folder of the job, for everyone who works on it
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Samples per pixel
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// Frames, as in 1-250: each is an image of its own, of the scene with -D frame=NUMBER
    #[arg(long, value_name = "FIRST-LAST", value_parser = parse_frames)]
    frames: Option<(u32, u32)>,
    /// Chunks of every image
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    chunks: u32,
    /// Take a quarter of the samples first, by which an allocator allocates the others, in a second round
    #[arg(long, value_name = "ALLOCATOR", num_args = 0..=1, default_missing_value = ALLOCATORS[0].id(), value_parser = render::allocator_names())]
    adaptive: Option<String>,
    /// Seed of the random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Options of `fluxion render` for every chunk, behind --
    #[arg(last = true, value_name = "OPTION")]
    options: Vec<String>,
}

/// First and last number of a range such as 1-250.
fn parse_frames(text: &str) -> Result<(u32, u32), String> {
    let wrong = || format!("`{text}` is no range such as 1-250");
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let frames = (first.parse().map_err(|_| wrong())?, last.parse().map_err(|_| wrong())?);
    if frames.0 <= frames.1 && frames.1 < u32::MAX { Ok(frames) } else { Err(wrong()) }
}

/// Writes the plan, and what hands its chunks to schedulers.
pub fn run(args: &Args) -> Result<ExitCode> {
    let folder = &args.output;
    if folder.join("job.json").exists() {
        bail!(Error::Usage(format!("{} has a job already: take another folder", folder.display())));
    }
    let Args { frames, spp, chunks, seed, .. } = *args;
    let Args { scenes, options, adaptive, .. } = args;
    let adaptive = adaptive.as_deref();
    let job = Job::new(&Settings { folder, scenes, frames, spp, chunks, seed, adaptive, options })?;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let absolute = folder.canonicalize().map_err(|error| Error::io(folder, error))?;
    schedulers::write(folder, &absolute, &job.rounds())?;
    job.save()?;
    let second = if job.adaptive.is_some() { ", after `fluxion job allocate` each of commands-2.txt" } else { "" };
    out!("{}: {} chunks; each line of commands.txt renders one{second}", folder.display(), job.chunks())?;
    Ok(ExitCode::SUCCESS)
}
