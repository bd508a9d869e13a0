//! Options of the differences between pixels.

use clap::builder::{PossibleValue, PossibleValuesParser};
use fluxion::pipeline::Differences;
use fluxion::render::{SHIFTS, Shift};

/// Options of the differences, which the defaults suit.
#[derive(clap::Args)]
#[command(next_help_heading = "Differences")]
pub struct Args {
    /// How paths are shifted to neighbouring pixels
    #[arg(long, default_value = SHIFTS[0].id, value_parser = shift_names(), hide_short_help = true)]
    shift: String,
    /// Roughness above which `reconnect` connects paths at a material instead of copying half vectors
    #[arg(long, value_name = "ALPHA", hide_short_help = true)]
    shift_threshold: Option<f32>,
    /// Samples in which paths are shifted
    #[arg(long, default_value = "auto", value_enum, hide_short_help = true, value_name = "WHEN")]
    differences: Shifted,
    /// Neighbours that paths are shifted to; `fluxion info --kernels` lists them
    #[arg(long, default_value = "cross", hide_short_help = true, value_name = "NAME[:KEY=VALUE,...]")]
    pub kernel: String,
    /// Samples without differences that neighbours are chosen by, for kernels that look at the picture [default: 4, of `learned` 8]
    #[arg(long, hide_short_help = true, value_name = "SPP", value_parser = clap::value_parser!(u32).range(1..))]
    pub pilot: Option<u32>,
}

/// Samples in which paths are shifted.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Shifted {
    /// Fewer where that is costly, for methods that ask for no more.
    Auto,
    /// All.
    Always,
}

fn shift_names() -> PossibleValuesParser {
    SHIFTS.iter().map(|kind| PossibleValue::new(kind.id).help(kind.summary)).collect::<Vec<_>>().into()
}

impl Args {
    /// The shift mapping.
    pub fn shift(&self) -> Shift {
        let shift = Shift::named(&self.shift).unwrap_or_default();
        self.shift_threshold.map_or(shift, |threshold| shift.with_threshold(threshold))
    }

    /// Samples in which paths are shifted.
    pub fn differences(&self) -> Differences {
        match self.differences {
            Shifted::Auto => Differences::Auto,
            Shifted::Always => Differences::Always,
        }
    }

    /// The shift mapping as options, for messages.
    pub fn as_text(&self) -> String {
        let threshold = self.shift_threshold.map_or(String::new(), |alpha| format!(" --shift-threshold {alpha}"));
        format!(" --shift {}{threshold}", self.shift)
    }
}
