//! One error type for the whole library: what is wrong, where, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What every fallible function of the library returns.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A place in an input file, for messages: `scene.xml:12`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file, as the user or the scene named it.
    pub file: Arc<Path>,
    /// Line number from 1; 0 when the whole file is meant.
    pub line: u32,
}

impl Place {
    /// The whole of `file`.
    pub fn file(file: &Path) -> Self {
        Self { file: Arc::from(file), line: 0 }
    }

    /// `line` of `file`, counted from 1.
    pub fn line(file: &Path, line: u32) -> Self {
        Self { file: Arc::from(file), line }
    }

    /// The input here is malformed.
    pub fn invalid(&self, what: impl Into<String>) -> Error {
        Error::Invalid { place: self.clone(), what: what.into() }
    }

    /// The input here asks for something Fluxion does not do.
    pub fn unsupported(&self, what: impl Into<String>) -> Error {
        Error::Unsupported { place: self.clone(), what: what.into() }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if self.line > 0 { write!(f, ":{}", self.line) } else { Ok(()) }
    }
}

/// Why something could not be done.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The input is well formed but asks for something that is not there; the text says what is supported.
    #[error("{place}: {what}")]
    Unsupported {
        /// Where it is asked for.
        place: Place,
        /// What is asked for and what there is instead.
        what: String,
    },
    /// The input is malformed.
    #[error("{place}: {what}")]
    Invalid {
        /// Where.
        place: Place,
        /// What is wrong and what was expected.
        what: String,
    },
    /// A frame lacks a layer that the method needs.
    #[error("layer `{layer}` is missing; {remedy}")]
    Missing {
        /// The layer's name in files.
        layer: String,
        /// How to get it.
        remedy: String,
    },
    /// A parameter or option has a value that makes no sense.
    #[error("{0}")]
    Usage(String),
    /// The system could not read or write a file.
    #[error("{}: {what}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's or the image library's reason.
        what: String,
    },
    /// Embree refused to build or to run.
    #[error("embree: {0}")]
    Embree(String),
}

impl Error {
    /// Wraps a reason for failing on `path`.
    pub fn io(path: &Path, what: impl fmt::Display) -> Self {
        Self::Io { path: path.to_path_buf(), what: what.to_string() }
    }
}
