//! The `fluxion` program: parse, dispatch, print the error chain once.

mod cli;

use std::process::ExitCode;

use clap::Parser;
use fluxion::error::Error;

#[global_allocator]
static ALLOCATOR: fluxion::ffi::memory::Allocator = fluxion::ffi::memory::Allocator;

fn main() -> ExitCode {
    match cli::run(cli::Args::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            match error.downcast_ref() {
                Some(Error::Usage(_)) => ExitCode::from(2),
                _ => ExitCode::FAILURE,
            }
        }
    }
}
