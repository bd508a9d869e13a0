//! The command line: one file per command.

mod bench;
mod checkpoint;
mod compare;
mod dataset;
#[cfg(test)]
mod documents;
mod host;
mod info;
mod interrupt;
mod job;
mod json;
mod machine;
mod merge;
mod method;
mod outputs;
mod progress;
mod reconstruct;
mod reference;
mod render;
mod scene;
mod schema;
mod shell;
mod statistics;
mod stored;
mod stress;
pub mod terminal;
mod validate;
mod viewer;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Result;
use clap::{Parser, Subcommand};

/// Renders scenes by gradient-domain path tracing and reconstructs clean images.
#[derive(Parser)]
#[command(name = "fluxion", version, arg_required_else_help = true, propagate_version = true)]
pub struct Args {
    #[command(flatten)]
    machine: machine::Args,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene and reconstruct its image
    Render(Box<render::Args>),
    /// Reconstruct an image from saved layers
    Reconstruct(reconstruct::Args),
    /// Measure images against a reference
    Compare(compare::Args),
    /// Measure error against run time: scenes, methods, budgets, seeds
    Bench(bench::Args),
    /// Render the reference image of a scene, in waves that can be continued
    Reference(reference::Args),
    /// Render training data for denoisers: inputs of several sample counts and targets, of many scenes
    Dataset(dataset::Args),
    /// Render in chunks on many machines, by a folder and a command for each
    Job(job::Args),
    /// Add up the samples of checkpoints, from other machines or seeds
    Merge(merge::Args),
    /// Describe a scene and its plan, or list methods, layers, plugins, kernels and metrics
    Info(info::Args),
    /// Check numerical stability on hostile frames, systems and scenes
    Stress(stress::Args),
    /// Render bundled scenes and check them against their references
    Validate(validate::Args),
    /// Print a shell's script for completing commands and options
    Completions {
        /// Shell that is to complete them
        shell: clap_complete::Shell,
    },
    /// Write manual pages of all commands
    Man {
        /// Folder for them
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
    },
    /// Print the JSON Schema of a kind of output
    Schema {
        /// Kind of JSON
        #[arg(value_enum)]
        kind: schema::Kind,
    },
}

/// Runs a command. The exit code is 1 for a check that failed; for work that a signal has stopped it is 75 if a checkpoint holds
/// all of it, else 128 and the signal's number; errors are the caller's to print.
pub fn run(args: Args) -> Result<ExitCode> {
    args.machine.apply()?;
    let code = match args.command {
        Command::Render(args) => render::run(&args),
        Command::Reconstruct(args) => reconstruct::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Reference(args) => reference::run(&args),
        Command::Dataset(args) => dataset::run(&args),
        Command::Job(args) => job::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Stress(args) => stress::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Completions { shell } => shell::completions(shell),
        Command::Man { output } => shell::manual(&output),
        Command::Schema { kind } => schema::run(kind),
    }?;
    Ok(interrupt::stopped().unwrap_or(code))
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

/// A positive number.
fn parse_positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|&number: &f64| number > 0.0 && number.is_finite());
    number.ok_or_else(|| "this must be a positive number".into())
}

/// Seconds, or a number with the unit s, m or h.
fn parse_time(text: &str) -> Result<Duration, String> {
    let units = [("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let split = units.iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, *seconds)));
    let (number, unit) = split.unwrap_or((text, 1.0));
    let seconds = number.parse::<f64>().ok().filter(|&t| t > 0.0).map(|t| t * unit);
    let duration = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    duration.ok_or_else(|| format!("`{text}` is not a positive time, as in 60, 1.5s, 30m or 2h"))
}

/// `NAME=VALUE`.
fn parse_definition(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("a definition is written NAME=VALUE")?;
    Ok((name.to_owned(), value.to_owned()))
}
