//! `fluxion job`: jobs of many chunks, a folder for each.

mod plan;
mod status;

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

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
    /// Render chunks, unless they are complete; go on with those that were interrupted
    Run {
        /// Folder of the job
        job: PathBuf,
        /// Numbers of the chunks, from 0 on, as in 7 or 3,17,200-203
        #[arg(value_parser = parse_chunks, value_name = "CHUNKS")]
        chunks: Chunks,
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
        Command::Run { job, chunks } => render(job, chunks),
        Command::Allocate { job } => allocate(job),
        Command::Status(args) => status::run(args),
        Command::Merge { job, partial, no_image } => merge(job, *partial, !no_image),
    }
}

/// Numbers of chunks, as `job status --missing` prints them.
#[derive(Clone)]
struct Chunks(Vec<RangeInclusive<usize>>);

fn parse_chunks(text: &str) -> Result<Chunks, String> {
    let range = |part: &str| parse_range(part.trim()).map(|(first, last)| first..=last);
    let ranges = text.split(',').map(range).collect::<Option<_>>();
    ranges.map(Chunks).ok_or_else(|| "chunks are written as in 7 or 3,17,200-203".to_owned())
}

/// First and last number of a range such as 1-250, or a number twice.
fn parse_range<T: FromStr + PartialOrd>(text: &str) -> Option<(T, T)> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let (first, last) = (first.parse().ok()?, last.parse().ok()?);
    (first <= last).then_some((first, last))
}

/// Renders chunks one after the other, until one is stopped.
fn render(folder: &Path, chunks: &Chunks) -> Result<ExitCode> {
    let job = Job::load(folder)?;
    for number in chunks.0.iter().flat_map(Clone::clone) {
        if !render_chunk(&job, number)? {
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Renders a chunk; false if that was stopped.
fn render_chunk(job: &Job, number: usize) -> Result<bool> {
    let part = job.unfinished(number);
    say_what_is_kept(format!("; the last checkpoint, if there was time for one, is kept in {}", part.display()));
    let (chunk, stats, is_complete) = match hosted(&[], |_| true, |host| job.run(number, host))?? {
        ChunkEnd::Complete => {
            note!("chunk {number} is complete");
            return Ok(true);
        }
        ChunkEnd::Rendered(chunk, stats) => (chunk, stats, true),
        ChunkEnd::Stopped(chunk, stats) => (chunk, stats, false),
    };
    interrupt::saved();
    let seconds = progress::seconds(std::time::Duration::from_secs_f64(stats.seconds.render));
    let (name, first) = (job.name(chunk.image), chunk.first);
    let what = if is_complete { "is complete" } else { "was stopped, and is saved" };
    out!("chunk {number} {what}: {} samples per pixel of {name} from number {first} on, in {seconds}", stats.spp)?;
    Ok(is_complete)
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
