//! Options of a reconstruction, as `render` and `reconstruct` take them.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use fluxion::pipeline::MethodRecipe;
use fluxion::reconstruct;

/// Options of the reconstruction.
#[derive(clap::Args)]
#[command(next_help_heading = "Reconstruction")]
pub struct Args {
    /// Reconstruction with its parameters; `fluxion info --methods` lists them
    #[arg(long, default_value = reconstruct::DEFAULT, value_name = "NAME[:KEY=VALUE,...]")]
    method: String,
    /// Megabytes that the reconstruction may use besides the layers; the image is the same
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..1 << 40), hide_short_help = true)]
    max_memory: Option<u64>,
    /// Folder for the intermediate images of the method, as EXR files
    #[arg(long, value_name = "DIR", hide_short_help = true)]
    pub notes: Option<PathBuf>,
}

/// Exposure of images of 8 bits.
#[derive(clap::Args)]
pub struct Exposure {
    /// Exposure of png and jpg images, in powers of two: 1 makes them twice as bright
    #[arg(
        long, default_value_t = 0.0, value_name = "EV", allow_negative_numbers = true, value_parser = parse_exposure,
        help_heading = "Output"
    )]
    pub exposure: f32,
}

fn parse_exposure(text: &str) -> Result<f32, String> {
    let exposure = text.parse().ok().filter(|exposure: &f32| exposure.abs() <= 100.0);
    exposure.ok_or_else(|| "an exposure is a number of powers of two, as in 1.5 or -2".into())
}

impl Args {
    /// The method of a recipe.
    pub fn recipe(&self) -> MethodRecipe {
        let memory = self.max_memory.map(|megabytes| megabytes << 20);
        MethodRecipe { name: self.method.clone(), memory, notes: self.notes.is_some() }
    }

    /// Makes the folder of intermediate images, so that they can be written in the end.
    pub fn make_folder(&self) -> Result<()> {
        let Some(folder) = &self.notes else { return Ok(()) };
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))
    }
}
