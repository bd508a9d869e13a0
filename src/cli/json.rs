//! The option `--json FILE`, which means the same in every command that has it.

use std::path::{Path, PathBuf};

use anyhow::Result;
use fluxion::image::io;
use fluxion::internals::files;
use serde::Serialize;

use super::terminal::out;

/// Name that means standard output.
const STDOUT: &str = "-";

/// File of a command's figures.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Args {
    /// JSON file for the figures; - is standard output
    #[arg(long, value_name = "FILE", value_parser = parse, help_heading = "Output")]
    json: Option<PathBuf>,
}

/// A file that is no image: an image behind `--json` was meant to be read.
fn parse(text: &str) -> Result<PathBuf, String> {
    match io::check_writable(Path::new(text)) {
        Ok(()) => Err(format!("{text} is the name of an image: JSON goes to a file, or to - for standard output")),
        Err(_) => Ok(text.into()),
    }
}

impl Args {
    /// Whether JSON is asked for.
    pub fn is_wanted(&self) -> bool {
        self.json.is_some()
    }

    /// The file, unless it is standard output.
    pub fn file(&self) -> Option<PathBuf> {
        self.json.clone().filter(|path| path.as_os_str() != STDOUT)
    }

    /// Writes something, if it is asked for.
    pub fn write(&self, value: &impl Serialize) -> Result<()> {
        let Some(path) = &self.json else { return Ok(()) };
        let text = serde_json::to_string_pretty(value)?;
        if path.as_os_str() == STDOUT { out!("{text}") } else { Ok(files::write(path, text + "\n")?) }
    }
}
