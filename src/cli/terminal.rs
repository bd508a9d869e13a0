//! Standard output and standard error. Neither may end the program: whoever reads them may have gone away.

use std::fmt::Arguments;
use std::io::{self, Write};

use anyhow::{Result, anyhow};

/// Writes a line to standard output. The error of a closed pipe is one that [`is_closed_pipe`] knows.
pub fn write_line(line: Arguments) -> Result<()> {
    let written = writeln!(io::stdout().lock(), "{line}");
    written.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => error.into(),
        _ => anyhow!("standard output: {error}"),
    })
}

/// Writes a line to standard error, if that is possible.
pub fn note_line(line: Arguments) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// Whether an error only says that nobody reads standard output any more, as after `| head`.
pub fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

/// `println!` as a `Result`.
macro_rules! out {
    ($($arg:tt)*) => { $crate::cli::terminal::write_line(format_args!($($arg)*)) };
}

/// `eprintln!` that never panics.
macro_rules! note {
    ($($arg:tt)*) => { $crate::cli::terminal::note_line(format_args!($($arg)*)) };
}

pub(crate) use {note, out};
