//! `fluxion job status`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use schemars::JsonSchema;
use serde::Serialize;

use super::chunk::State;
use super::description::Job;
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
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Numbers of chunks by their states.
#[derive(Default, Serialize, JsonSchema)]
pub struct Status {
    chunks: usize,
    complete: usize,
    started: Vec<usize>,
    missing: Vec<usize>,
    waiting: Vec<usize>,
    wrong: Vec<usize>,
}

/// Prints the state of all chunks.
pub fn run(args: &Args) -> Result<ExitCode> {
    let job = Job::load(&args.job)?;
    let mut status = Status { chunks: job.chunks(), ..Status::default() };
    for number in 0..job.chunks() {
        match job.state(number, args.verify)? {
            State::Complete => status.complete += 1,
            State::Started => status.started.push(number),
            State::Missing => status.missing.push(number),
            State::Waiting => status.waiting.push(number),
            State::Wrong => status.wrong.push(number),
        }
    }
    if args.json {
        out!("{}", serde_json::to_string_pretty(&status)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    if args.missing {
        let mut left = [status.started, status.missing, status.wrong].concat();
        left.sort_unstable();
        out!("{}", ranges(&left))?;
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

/// Ascending numbers as schedulers take them: 3,17,200-203.
pub fn ranges(numbers: &[usize]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let text = runs.map(|run| match run {
        [one] => one.to_string(),
        [first, .., last] => format!("{first}-{last}"),
        [] => String::new(),
    });
    text.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn numbers_that_follow_each_other_are_ranges() {
        assert_eq!(ranges(&[3, 17, 200, 201, 202, 203]), "3,17,200-203");
        assert_eq!((ranges(&[]), ranges(&[0, 1])), (String::new(), "0-1".to_owned()));
    }
}
