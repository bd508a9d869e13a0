//! `fluxion job`: a render in chunks for many machines. A folder is the only state: `job.json`, the plan, and a checkpoint for each
//! chunk, `0003.ckpt` when it is complete and `0003.part.ckpt` before.
//!
//! ```text
//! plan --job.json--> run 0, 1, 2, ... (on any machine) --checkpoints--> status, merge --> images
//!                     ^                                        |
//!                     +---- goals of a second round -- allocate <+
//! ```

mod allocate;
mod chunk;
mod description;
mod merge;
mod plan;
mod run;
mod schedulers;
mod status;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Subcommand;

pub use self::description::Job;
pub use self::status::Status;

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
    Merge(merge::Args),
}

/// Carries out a command.
pub fn run(args: &Args) -> Result<ExitCode> {
    match &args.command {
        Command::Plan(args) => plan::run(args),
        Command::Run { job, chunk } => run::run(job, *chunk),
        Command::Allocate { job } => allocate::run(job),
        Command::Status(args) => status::run(args),
        Command::Merge(args) => merge::run(args),
    }
}
