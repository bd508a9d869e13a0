//! `fluxion job allocate`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Result, bail};
use fluxion::adaptive::Goals;
use fluxion::checkpoint;
use fluxion::error::Error;
use fluxion::reconstruct::{self, Context};

use super::description::Job;
use super::status::ranges;
use crate::cli::terminal::{note, out};

/// Allocates the samples of the second round by those of the first, and divides them into chunks.
pub fn run(folder: &Path) -> Result<ExitCode> {
    let job = Job::load(folder)?;
    let Some(first) = &job.adaptive else {
        bail!(Error::Usage("this job has one round, with nothing to allocate: plan two by --adaptive".into()));
    };
    if job.allocated.is_some() {
        note!("the second round is allocated");
        return Ok(ExitCode::SUCCESS);
    }
    let mut bounds = Vec::new();
    for image in 0..job.images() {
        let (films, left) = job.films(job.first_round(image))?;
        if !left.is_empty() {
            let what = format!("chunks {} of {} are not complete", ranges(&left), job.name(image));
            bail!(Error::Usage(format!("{what}: run them first")));
        }
        let (frame, merged) = checkpoint::develop(&films, &job.goals(image))?;
        let method = reconstruct::parse(&merged.origin.method)?;
        let goals = Goals::new(&frame, job.spp, (method.as_ref(), first.allocator()?), &Context::QUIET)?;
        goals.save(&job.goals(image))?;
        bounds.push(goals.divide(first.spp, job.second_chunks()));
        let (least, most) = (goals.counts.iter().min().unwrap_or(&0), goals.counts.iter().max().unwrap_or(&0));
        out!("{}: {least} to {most} samples a pixel", job.name(image))?;
    }
    job.allocate(&bounds)?;
    Ok(ExitCode::SUCCESS)
}
