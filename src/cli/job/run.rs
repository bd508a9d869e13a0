//! `fluxion job run`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Result, bail};
use fluxion::error::Error;

use super::chunk::{self, Job, State};
use crate::cli::terminal::note;
use crate::cli::{interrupt, render};

/// Renders a chunk. It may be run any number of times: what is complete is left alone, what was interrupted is resumed.
pub fn run(folder: &Path, number: usize) -> Result<ExitCode> {
    let job = Job::load(folder)?;
    let (part, whole) = (chunk::unfinished(folder, number), chunk::complete(folder, number));
    match chunk::state(&job, folder, number, false)? {
        State::Complete => {
            note!("chunk {number} is complete");
            return Ok(ExitCode::SUCCESS);
        }
        State::Wrong => {
            bail!(Error::mismatch(&whole, "is no checkpoint of this chunk: remove it, and run the chunk again"))
        }
        State::Started | State::Missing => {}
    }
    let code = render::run(&*job.render(&job.chunk(number)?, &part)?)?;
    if interrupt::stopped().is_none() {
        std::fs::rename(&part, &whole).map_err(|error| Error::io(&whole, error))?;
    }
    Ok(code)
}
