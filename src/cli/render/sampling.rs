//! Options of the samples.

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser};
use fluxion::adaptive::{ALLOCATORS, Allocator, Limits};
use fluxion::pipeline::Extent;

use crate::cli::{parse_positive, parse_time};

/// Options of the samples.
#[derive(clap::Args)]
#[command(next_help_heading = "Sampling")]
pub struct Args {
    /// Samples per pixel [default: the scene's own]
    #[arg(long, conflicts_with = "time", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Time for everything but reading and writing, as in 60, 60s or 5m; of a method that does not estimate its error the
    /// reconstruction time is not counted
    #[arg(long, value_parser = parse_time, value_name = "TIME")]
    time: Option<Duration>,
    /// Stop when the estimated relMSE is below this; --spp or --time is a limit then
    #[arg(long, value_name = "RELMSE", value_parser = parse_positive)]
    target_error: Option<f64>,
    /// Give more samples to the pixels that need them, by an allocator. With --time or --target-error this is the default if the
    /// method estimates its error; `uniform` gives all pixels the same number
    #[arg(long, value_name = "ALLOCATOR", num_args = 0..=1, default_missing_value = ALLOCATORS[0].id(), value_parser = allocator_names())]
    pub adaptive: Option<String>,
    /// Seed of the random numbers; the same seed gives the same bits on any number of threads
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Number of the first sample of every pixel: films of one seed with consecutive samples are better stratified
    /// together than films of different seeds
    #[arg(long, default_value_t = 0, hide_short_help = true, value_name = "N")]
    pub first: u32,
    /// Samples that every pixel is to have, as an EXR file with a channel `samples`, such as another render's image: numbers
    /// from --first on, at most --spp of them
    #[arg(long, conflicts_with_all = ["time", "adaptive", "target_error", "samples"], hide_short_help = true, value_name = "FILE")]
    pub goals: Option<PathBuf>,
    /// Compute what scene, method and layers need, or everything, to see the savings
    #[arg(long, default_value = "needed", value_enum, value_name = "WHAT", hide_short_help = true)]
    plan: Planned,
    /// Trace one sample again and print it: column, row and number of the sample
    #[arg(long, value_parser = parse_sample, value_name = "X,Y,S", hide_short_help = true)]
    pub replay: Option<(usize, usize, u32)>,
}

/// Extent of the plan.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Planned {
    /// Only what is needed.
    Needed,
    /// Everything that can be recorded.
    All,
}

impl Args {
    /// End of the render.
    pub fn limits(&self) -> Limits {
        Limits { spp: self.spp, time: self.time, error: self.target_error }
    }

    /// Extent of the plan.
    pub fn extent(&self) -> Extent {
        match self.plan {
            Planned::Needed => Extent::Needed,
            Planned::All => Extent::All,
        }
    }
}

/// Names of allocators, as values of options.
pub fn allocator_names() -> PossibleValuesParser {
    let name = |allocator: &&dyn Allocator| PossibleValue::new(allocator.id()).help(allocator.summary());
    ALLOCATORS.iter().map(name).collect::<Vec<_>>().into()
}

fn parse_sample(text: &str) -> Result<(usize, usize, u32), String> {
    let parts: Vec<_> = text.split(',').map(str::trim).collect();
    let error = || "a sample is written X,Y,S, as in 10,20,3".to_owned();
    match parts.as_slice() {
        [x, y, s] => {
            Ok((x.parse().map_err(|_| error())?, y.parse().map_err(|_| error())?, s.parse().map_err(|_| error())?))
        }
        _ => Err(error()),
    }
}
