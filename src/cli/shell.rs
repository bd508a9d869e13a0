//! `fluxion completions` and `fluxion man`: what a shell knows of the program.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::CommandFactory;
use clap_complete::Shell;

use super::Args;
use super::terminal::out;

/// Prints a shell's script.
pub fn completions(shell: Shell) -> Result<ExitCode> {
    let (mut command, mut script) = (Args::command(), Vec::new());
    let name = command.get_name().to_owned();
    clap_complete::generate(shell, &mut command, name, &mut script);
    out!("{}", String::from_utf8_lossy(&script).trim_end())?;
    Ok(ExitCode::SUCCESS)
}

/// Writes `fluxion.1`, and a page for every command.
pub fn manual(folder: &Path) -> Result<ExitCode> {
    let failed = || format!("cannot write manual pages to {}", folder.display());
    std::fs::create_dir_all(folder).with_context(failed)?;
    clap_mangen::generate_to(Args::command(), folder).with_context(failed)?;
    Ok(ExitCode::SUCCESS)
}
