//! The `fluxion` program: parse, dispatch, print the error chain once.

mod cli;

use std::process::ExitCode;

use clap::Parser;
use fluxion::error::Error;
use fluxion::internals::ffi::vectors::Vectors;

use self::cli::terminal;

#[global_allocator]
static ALLOCATOR: fluxion::internals::ffi::memory::Allocator = fluxion::internals::ffi::memory::Allocator;

fn main() -> ExitCode {
    let args = cli::Args::parse();
    match Vectors::allowed().map_err(anyhow::Error::from).and_then(|_| cli::run(args)) {
        Ok(code) => code,
        Err(error) if terminal::is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::note!("error: {error:#}");
            if error.downcast_ref().is_some_and(Error::is_usage) { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}
