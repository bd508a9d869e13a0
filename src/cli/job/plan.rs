//! `fluxion job plan`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use fluxion::error::Error;
use fluxion::files;

use super::chunk::Job;
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
    /// Chunks of every scene
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    chunks: u32,
    /// Seed of the random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Options of `fluxion render` for every chunk, behind --
    #[arg(last = true, value_name = "OPTION")]
    options: Vec<String>,
}

/// Writes the plan and the list of commands.
pub fn run(args: &Args) -> Result<ExitCode> {
    let folder = &args.output;
    if folder.join("job.json").exists() {
        bail!(Error::Usage(format!("{} has a job already: take another folder", folder.display())));
    }
    let job = Job::new(&args.scenes, (args.spp, args.chunks), args.seed, &args.options)?;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let absolute = folder.canonicalize().map_err(|error| Error::io(folder, error))?;
    let quoted = absolute.display().to_string().replace('\'', r"'\''");
    let command = |number| format!("fluxion job run '{quoted}' {number}\n");
    files::write(&folder.join("commands.txt"), (0..job.chunks()).map(command).collect::<String>())?;
    job.save(folder)?;
    out!("{}: {} chunks; each line of commands.txt renders one", folder.display(), job.chunks())?;
    Ok(ExitCode::SUCCESS)
}
