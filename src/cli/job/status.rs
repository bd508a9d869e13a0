//! `fluxion job status`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use fluxion::job::{Job, Status, ranges};

use crate::cli::json;
use crate::cli::terminal::out;

/// Options of `job status`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder of the job
    job: PathBuf,
    /// Print only the numbers of the chunks that are not complete and can be run, as in 3,17,200-203
    #[arg(long, conflicts_with = "json")]
    missing: bool,
    /// Read the files of complete chunks from end to end
    #[arg(long)]
    verify: bool,
    #[command(flatten)]
    json: json::Args,
}

/// Prints the state of all chunks.
pub fn run(args: &Args) -> Result<ExitCode> {
    let status = Job::load(&args.job)?.status(args.verify)?;
    if args.json.is_wanted() {
        args.json.write(&status)?;
        return Ok(ExitCode::SUCCESS);
    }
    if args.missing {
        out!("{}", ranges(&status.due()))?;
        return Ok(ExitCode::SUCCESS);
    }
    out!("{} of {} chunks are complete", status.complete, status.chunks)?;
    let Status { started, missing, waiting, wrong, .. } = &status;
    for (what, numbers) in [
        ("started", started),
        ("missing", missing),
        ("waiting for `fluxion job allocate`", waiting),
        ("damaged or foreign", wrong),
    ] {
        if !numbers.is_empty() {
            out!("{what}: {}", ranges(numbers))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
