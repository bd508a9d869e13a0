//! `fluxion job plan`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Result, bail};
use clap::Parser;
use fluxion::adaptive::{ALLOCATORS, Limits};
use fluxion::error::Error;
use fluxion::job::{Job, Settings};
use fluxion::pipeline::Recipe;

use crate::cli::host::warn;
use crate::cli::terminal::out;
use crate::cli::{Args as CliArgs, Command, render};

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
    /// Frames, as in 1-250: each is an image of its own, of the scene with -D frame=NUMBER
    #[arg(long, value_name = "FIRST-LAST", value_parser = parse_frames)]
    frames: Option<(u32, u32)>,
    /// Chunks of every image
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    chunks: u32,
    /// Take a quarter of the samples first, by which an allocator allocates the others, in a second round
    #[arg(long, value_name = "ALLOCATOR", num_args = 0..=1, default_missing_value = ALLOCATORS[0].id(), value_parser = render::allocator_names())]
    adaptive: Option<String>,
    /// Seed of the random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Options of `fluxion render` for every chunk, behind --
    #[arg(last = true, value_name = "OPTION")]
    options: Vec<String>,
}

/// First and last number of a range such as 1-250.
fn parse_frames(text: &str) -> Result<(u32, u32), String> {
    let range = super::parse_range(text).filter(|&(_, last)| last < u32::MAX);
    range.ok_or_else(|| format!("`{text}` is not a range such as 1-250"))
}

/// The options of `fluxion render` behind the --.
struct Chunks {
    recipe: Recipe,
    checkpoint_every: Duration,
    /// Options of the machine, which go to the commands of the chunks.
    machine: Vec<String>,
}

fn chunks(args: &Args) -> Result<Chunks> {
    // The job says of these, so they cannot be said again.
    let said =
        ["fluxion", "render", "scene.xml", "--spp", "1", "--first", "0", "--seed", "0", "--checkpoint", "c.ckpt"];
    let line = said.into_iter().chain(args.options.iter().map(String::as_str));
    match CliArgs::try_parse_from(line) {
        Ok(CliArgs { command: Command::Render(render), machine }) => {
            if let Some(name) = render.not_of_chunks() {
                bail!(Error::Usage(format!("{name} has no meaning for the chunks of a job")));
            }
            let recipe = Recipe { seed: args.seed, ..render.recipe() };
            let limits = Limits { spp: None, ..recipe.limits };
            let (checkpoint_every, machine) = (render.checkpoint_every(), machine.words());
            Ok(Chunks { recipe: Recipe { limits, ..recipe }, checkpoint_every, machine })
        }
        Ok(_) => bail!(Error::Usage("options of the chunks are those of `fluxion render`".into())),
        Err(error) => bail!(Error::Usage(format!("options of the chunks: {error}"))),
    }
}

/// Writes the plan, and what hands its chunks to schedulers.
pub fn run(args: &Args) -> Result<ExitCode> {
    let Chunks { recipe, checkpoint_every, machine } = chunks(args)?;
    let (folder, adaptive): (&Path, _) = (&args.output, args.adaptive.as_deref());
    let Args { scenes, frames, spp, chunks, .. } = args;
    let (frames, spp, chunks) = (*frames, *spp, *chunks);
    let settings = Settings { folder, scenes, frames, spp, chunks, adaptive, recipe: &recipe, checkpoint_every };
    let job = Job::new(&settings, &warn)?;
    job.create(&machine)?;
    let second = if job.adaptive.is_some() { ", after `fluxion job allocate` each of commands-2.txt" } else { "" };
    out!("{}: {} chunks; each line of commands.txt renders one{second}", folder.display(), job.chunks())?;
    Ok(ExitCode::SUCCESS)
}
