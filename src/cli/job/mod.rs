//! `fluxion job`: jobs of many chunks, a folder for each.

mod plan;
mod status;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use clap::Subcommand;
use fluxion::internals::ffi::memory::say_what_is_kept;
use fluxion::job::{ChunkEnd, Job};

use super::host::{hosted, watched};
use super::terminal::{note, out};
use super::{interrupt, progress};

/// Options of `job`.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Divide renders into chunks: job.json, commands.txt with a command for each, slurm.sh and openjd.yaml
    Plan(plan::Args),
    /// Render a chunk, unless it is complete; go on with it if it was interrupted
    Run {
        /// Folder of the job
        job: PathBuf,
        /// Number of the chunk, from 0 on
        chunk: usize,
    },
    /// Allocate the samples of an adaptive job's second round, when the first is complete
    Allocate {
        /// Folder of the job
        job: PathBuf,
    },
    /// Say which chunks are complete
    Status(status::Args),
    /// Add up the chunks of every image, and reconstruct it
    Merge {
        /// Folder of the job
        job: PathBuf,
        /// Take what is complete, though some chunks are not
        #[arg(long)]
        partial: bool,
        /// Make checkpoints of all samples, but no images
        #[arg(long)]
        no_image: bool,
    },
}

/// Carries out a command.
pub fn run(args: &Args) -> Result<ExitCode> {
    match &args.command {
        Command::Plan(args) => plan::run(args),
        Command::Run { job, chunk } => render(job, *chunk),
        Command::Allocate { job } => allocate(job),
        Command::Status(args) => status::run(args),
        Command::Merge { job, partial, no_image } => merge(job, *partial, !no_image),
    }
}

fn render(folder: &Path, number: usize) -> Result<ExitCode> {
    let job = Job::load(folder)?;
    let part = job.unfinished(number);
    say_what_is_kept(format!("; the last checkpoint, if there was time for one, is kept in {}", part.display()));
    let (chunk, stats, what) = match hosted(&[], |_| true, |host| job.run(number, host))?? {
        ChunkEnd::Complete => {
            note!("chunk {number} is complete");
            return Ok(ExitCode::SUCCESS);
        }
        ChunkEnd::Rendered(chunk, stats) => (chunk, stats, "is complete"),
        ChunkEnd::Stopped(chunk, stats) => (chunk, stats, "was stopped, and is saved"),
    };
    interrupt::saved();
    let seconds = progress::seconds(std::time::Duration::from_secs_f64(stats.seconds.render));
    let (name, first) = (job.name(chunk.image), chunk.first);
    out!("chunk {number} {what}: {} samples per pixel of {name} from number {first} on, in {seconds}", stats.spp)?;
    Ok(ExitCode::SUCCESS)
}

fn allocate(folder: &Path) -> Result<ExitCode> {
    let allocated = Job::load(folder)?.allocate()?;
    if allocated.is_empty() {
        note!("the second round is allocated");
    }
    for image in allocated {
        out!("{}: {} to {} samples a pixel", image.name, image.least, image.most)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn merge(folder: &Path, partial: bool, reconstruct: bool) -> Result<ExitCode> {
    let job = Job::load(folder)?;
    for image in 0..job.images() {
        let merged = watched(|host| job.merge(image, partial, reconstruct, host))?;
        out!("{}: {:.1} samples per pixel of {} chunks", merged.film.display(), merged.spp, merged.chunks)?;
        merged.image.iter().try_for_each(|image| out!("{}", image.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}
