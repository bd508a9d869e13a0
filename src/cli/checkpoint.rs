//! Options of checkpoints.

use std::path::PathBuf;
use std::time::Duration;

use fluxion::pipeline::Checkpoints;

/// Options of checkpoints.
#[derive(clap::Args)]
#[command(next_help_heading = "Long renders")]
pub struct Args {
    /// File to save all samples in from time to time, so that an interrupted render can be resumed
    #[arg(long, value_name = "FILE", group = "recorded")]
    pub checkpoint: Option<PathBuf>,
    /// Resume from the checkpoint, if it exists
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
    /// Time between checkpoints; slow ones are written less often, so that they take at most a hundredth of the time
    #[arg(
        long, default_value = "60s", value_parser = super::parse_time, requires = "checkpoint", value_name = "TIME",
        hide_short_help = true
    )]
    pub checkpoint_every: Duration,
}

impl Args {
    /// The checkpoints, if there are to be any.
    pub fn checkpoints(&self) -> Option<Checkpoints> {
        let (every, resume) = (self.checkpoint_every, self.resume);
        self.checkpoint.clone().map(|file| Checkpoints { file, every, resume })
    }
}
