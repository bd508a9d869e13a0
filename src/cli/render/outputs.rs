//! Options of the files that a render writes.

use std::path::PathBuf;

use fluxion::film::Needs;
use fluxion::pipeline::Outputs;

use crate::cli::viewer::Address;
use crate::cli::{json, method, statistics};

/// Options of the outputs.
#[derive(clap::Args)]
#[command(next_help_heading = "Output")]
pub struct Args {
    /// Image to write, by its extension: exr, hdr, pfm, tiff, png or jpg; may be given several times, and left out where a checkpoint
    /// or samples are all that is wanted
    #[arg(short, long, required_unless_present_any = ["replay", "checkpoint", "samples"], value_name = "FILE")]
    output: Vec<PathBuf>,
    #[command(flatten)]
    exposure: method::Exposure,
    /// EXR file of all recorded layers, for `fluxion reconstruct`
    #[arg(long, value_name = "FILE", group = "recorded")]
    layers: Option<PathBuf>,
    #[command(flatten)]
    statistics: statistics::Args,
    /// EXR file of Cryptomatte layers: shares of pixels by objects and materials, named by their ids in the scene file
    #[arg(long, value_name = "FILE")]
    cryptomatte: Option<PathBuf>,
    /// Images of the light of groups of emitters by themselves, which add up to the colour, as layers `light.NAME` of exr images:
    /// emitters by the patterns of their ids or those of their shapes, and a group without a pattern for all others
    #[arg(long, value_name = "NAME=PATTERN,...,NAME")]
    pub light_groups: Option<String>,
    /// Folder for every camera sample's colour, features and differences, as arrays for NumPy
    #[arg(
        long, value_name = "DIR", conflicts_with_all = ["time", "adaptive", "target_error", "checkpoint"],
        hide_short_help = true
    )]
    samples: Option<PathBuf>,
    #[command(flatten)]
    pub json: json::Args,
    /// Show the image in the viewer tev while it is rendered [tev:127.0.0.1:14158]
    #[arg(long, value_name = "tev[:HOST[:PORT]]", hide_short_help = true)]
    pub display: Option<Address>,
}

impl Args {
    /// Statistics that are asked for.
    pub fn statistics(&self) -> Needs {
        self.statistics.0
    }

    /// The outputs of a recipe, with a folder for intermediate images.
    pub fn outputs(&self, notes: Option<PathBuf>) -> Outputs {
        Outputs {
            images: self.output.clone(),
            image: self.json.is_wanted(),
            exposure: self.exposure.exposure,
            layers: self.layers.clone(),
            cryptomatte: self.cryptomatte.clone(),
            samples: self.samples.clone(),
            notes,
        }
    }
}
