//! `fluxion job merge`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::Parser;
use fluxion::checkpoint;
use fluxion::error::Error;

use super::description::Job;
use super::status::ranges;
use crate::cli::terminal::{note, out};
use crate::cli::{Args as CliArgs, Command, reconstruct};

/// Options of `job merge`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder of the job
    job: PathBuf,
    /// Take what is complete, though some chunks are not
    #[arg(long)]
    partial: bool,
    /// Make checkpoints of all samples, but no images
    #[arg(long)]
    no_image: bool,
}

/// Merges every image's chunks into NAME.ckpt, and reconstructs NAME.exr by the method that they were rendered for.
pub fn run(args: &Args) -> Result<ExitCode> {
    let job = Job::load(&args.job)?;
    for image in 0..job.images() {
        let (films, left) = job.films(job.first_round(image).chain(job.second_round(image)))?;
        let name = job.name(image);
        if !left.is_empty() {
            let what = format!("chunks {} of {name} are not complete", ranges(&left));
            if !args.partial || films.is_empty() {
                bail!(Error::Usage(format!("{what}: run them, or merge what there is by --partial")));
            }
            note!("warning: {what}: the image has fewer samples");
        }
        let merged = args.job.join(format!("{name}.ckpt"));
        let found = checkpoint::merge(&films, &merged)?;
        let pixels = (found.origin.size.0 * found.origin.size.1) as f64;
        out!("{}: {:.1} samples per pixel of {} chunks", merged.display(), found.samples as f64 / pixels, films.len())?;
        if !args.no_image {
            let image = args.job.join(format!("{name}.exr"));
            let [merged, image] = [merged, image].map(|path| path.display().to_string());
            let line = ["fluxion", "reconstruct", &merged, "-o", &image, "-q", "--method", &found.origin.method];
            let CliArgs { command: Command::Reconstruct(args), .. } = CliArgs::try_parse_from(line)? else { continue };
            reconstruct::run(&args)?;
            out!("{image}")?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
