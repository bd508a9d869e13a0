//! The command line: one file per command.

mod compare;
mod info;
mod method;
mod outputs;
mod progress;
mod reconstruct;
mod render;
mod stats;
mod validate;

use std::process::ExitCode;

use anyhow::Result;
use clap::{Parser, Subcommand};

/// Renders scenes by gradient-domain path tracing and reconstructs clean images.
#[derive(Parser)]
#[command(name = "fluxion", version, arg_required_else_help = true, propagate_version = true)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene and reconstruct its image
    Render(render::Args),
    /// Reconstruct an image from saved layers
    Reconstruct(reconstruct::Args),
    /// Measure an image against a reference
    Compare(compare::Args),
    /// Show what a scene holds and needs, or what Fluxion knows
    Info(info::Args),
    /// Render bundled scenes and check them against their references
    Validate(validate::Args),
}

/// Runs a command. The exit code is 1 for a check that failed; errors are the caller's to print.
pub fn run(args: Args) -> Result<ExitCode> {
    match args.command {
        Command::Render(args) => render::run(&args),
        Command::Reconstruct(args) => reconstruct::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Validate(args) => validate::run(&args),
    }
}

/// `WxH` as two positive numbers.
fn parse_size(text: &str) -> Result<(usize, usize), String> {
    let parse = |part: &str| part.parse().ok().filter(|&n| n > 0);
    let (width, height) = text.split_once(['x', 'X']).ok_or("a size is written WIDTHxHEIGHT, as in 1280x720")?;
    Ok((
        parse(width).ok_or("the width must be a positive number")?,
        parse(height).ok_or("the height must be a positive number")?,
    ))
}

/// `NAME=VALUE`.
fn parse_definition(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("a definition is written NAME=VALUE")?;
    Ok((name.to_owned(), value.to_owned()))
}

/// Makes all parallel work use this many threads (0: one per core).
fn use_threads(threads: usize) -> Result<()> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?)
}
