//! Common part of the commands that sample differences: the neighbours that paths are shifted to.

use anyhow::Result;
use fluxion::error::Error;
use fluxion::neighbours::Selector;
use fluxion::plan;
use fluxion::reconstruct::Reconstruction;

use super::terminal::note;

/// Options of the neighbours.
#[derive(clap::Args)]
pub struct Args {
    /// Neighbours that paths are shifted to; `fluxion info --kernels` lists them
    #[arg(long, default_value = "cross", hide_short_help = true, value_name = "NAME[:KEY=VALUE,...]")]
    kernel: String,
    /// Samples without differences that neighbours are chosen by, for kernels that look at the picture [default: 4, of `learned` 8]
    #[arg(long, hide_short_help = true, value_name = "SPP", value_parser = clap::value_parser!(u32).range(1..))]
    pilot: Option<u32>,
}

impl Args {
    /// Fails if films of different samples would choose neighbours of their own, so that they could not be merged.
    pub fn check_merging(&self) -> Result<()> {
        match Selector::parse(&self.kernel, self.pilot)?.pilot() {
            0 => Ok(()),
            _ => Err(Error::Usage(format!(
                "chunks cannot choose neighbours by pilots of their own: not --kernel {}",
                self.kernel
            ))
            .into()),
        }
    }

    /// The neighbours for a method and for films of so many samples, if that is known. The error says which methods take them.
    pub fn make(&self, method: &dyn Reconstruction, spp: Option<u32>) -> Result<Selector> {
        let wanted = Selector::parse(&self.kernel, self.pilot)?;
        let chosen = plan::kernel(wanted, method, spp)?;
        if chosen.is_cross() && !wanted.is_cross() {
            note!("warning: this method takes no differences: --kernel changes nothing");
        }
        Ok(chosen)
    }
}
