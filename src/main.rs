//! The `fluxion` program: parse, dispatch, print the error chain once.

mod cli;

use std::process::ExitCode;

use clap::Parser;
use fluxion::error::Error;

use self::cli::terminal;

#[global_allocator]
static ALLOCATOR: fluxion::ffi::memory::Allocator = fluxion::ffi::memory::Allocator;

fn main() -> ExitCode {
    match cli::run(cli::Args::parse()) {
        Ok(code) => code,
        Err(error) if terminal::is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::note!("error: {error:#}");
            match error.downcast_ref() {
                Some(Error::Usage(_)) => ExitCode::from(2),
                _ => ExitCode::FAILURE,
            }
        }
    }
}
