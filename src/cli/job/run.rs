//! `fluxion job run`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Result, bail};
use fluxion::error::Error;

use super::chunk::State;
use super::description::Job;
use crate::cli::terminal::note;
use crate::cli::{interrupt, render};

/// Renders a chunk. It may be run any number of times: what is complete is left alone, what was interrupted is resumed.
pub fn run(folder: &Path, number: usize) -> Result<ExitCode> {
    let job = Job::load(folder)?;
    let (part, whole) = (job.unfinished(number), job.complete(number));
    let state = job.state(number, false)?;
    if state == State::Complete {
        note!("chunk {number} is complete");
        return Ok(ExitCode::SUCCESS);
    }
    if state == State::Wrong {
        bail!(Error::mismatch(&whole, "is no checkpoint of this chunk: remove it, and run the chunk again"))
    }
    let Some(chunk) = job.chunk(number)? else {
        let what = format!("the samples of chunk {number} are not allocated yet: run those of the first round, then");
        bail!(Error::Usage(format!("{what} `fluxion job allocate {}`", folder.display())));
    };
    let code = render::run(&*job.render(&chunk, &part)?)?;
    if interrupt::stopped().is_none() {
        std::fs::rename(&part, &whole).map_err(|error| Error::io(&whole, error))?;
    }
    Ok(code)
}
