//! The `fluxion` program: parse, dispatch, print the error chain once.

mod cli;

use std::process::ExitCode;

use clap::Parser;
use fluxion::error::Error;

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
