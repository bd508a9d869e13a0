//! The error type of the library. Messages say what is wrong, where, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Result of every fallible function of the library.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A location in an input file, for messages: `scene.xml:12`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceLoc {
    /// The file, as the user or the scene named it.
    pub file: Arc<Path>,
    /// Line number from 1; 0 when the whole file is meant.
    pub line: u32,
}

impl SourceLoc {
    /// The whole of `file`.
    pub fn file(file: &Path) -> Self {
        Self { file: Arc::from(file), line: 0 }
    }

    /// `line` of `file`, counted from 1.
    pub fn line(file: &Path, line: u32) -> Self {
        Self { file: Arc::from(file), line }
    }

    /// The error of malformed input at this location.
    pub fn invalid(&self, what: impl Into<String>) -> Error {
        Error::Invalid { loc: self.clone(), what: what.into() }
    }

    /// The error of input at this location that asks for something Fluxion does not have.
    pub fn unsupported(&self, what: impl Into<String>) -> Error {
        Error::Unsupported { loc: self.clone(), what: what.into() }
    }
}

impl fmt::Display for SourceLoc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if self.line > 0 { write!(f, ":{}", self.line) } else { Ok(()) }
    }
}

/// The reason why something could not be done.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The input is well formed but asks for something that Fluxion does not have.
    #[error("{loc}: {what}")]
    Unsupported {
        /// Location of the request.
        loc: SourceLoc,
        /// The request, and what is supported instead.
        what: String,
    },
    /// The input is malformed.
    #[error("{loc}: {what}")]
    Invalid {
        /// Location of the fault.
        loc: SourceLoc,
        /// The fault, and what was expected.
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
    /// Values that make no sense where they stand, such as NaN in an image or a negative variance.
    #[error("{0}")]
    BadData(String),
    /// Two inputs that do not belong together: images of different shapes, films of different scenes.
    #[error("{0}")]
    Mismatch(String),
    /// A parameter or option has a value that makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A method may use less memory than it needs.
    #[error(
        "reconstructing {}x{} pixels with {method} takes {} MB besides the layers; allow it with --max-memory {}",
        size.0, size.1, megabytes(*bytes), megabytes(*bytes)
    )]
    TooLittleMemory {
        /// The method.
        method: &'static str,
        /// Width and height of the image.
        size: (usize, usize),
        /// Bytes that it needs.
        bytes: u64,
    },
    /// The system could not read or write a file, or the file is not what it should be.
    #[error("{}: {what}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's or the image library's reason.
        what: String,
    },
    /// Some outputs could not be written; the text says which, and where the image is.
    #[error("{0}")]
    NotWritten(String),
    /// A run has failed of which a checkpoint holds the samples.
    #[error("the samples are kept: `fluxion reconstruct {}` makes an image of them: {error}", path.display())]
    Kept {
        /// The checkpoint.
        path: PathBuf,
        /// Why the run has failed.
        error: Box<Error>,
    },
    /// A library that Fluxion calls has failed.
    #[error("{library}: {what}")]
    Backend {
        /// Name of the library.
        library: &'static str,
        /// The library's reason.
        what: String,
    },
}

/// Bytes in whole megabytes, which hold them.
fn megabytes(bytes: u64) -> u64 {
    bytes.div_ceil(1 << 20)
}

impl Error {
    /// Whether the caller asked for what cannot be: the program exits with 2 then.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Usage(_) | Self::TooLittleMemory { .. } => true,
            Self::Kept { error, .. } => error.is_usage(),
            _ => false,
        }
    }

    /// A name that is none of those that a table has: a method, an allocator, a metric.
    pub fn unknown<'a>(what: &str, name: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        let known: Vec<_> = known.into_iter().collect();
        Self::Usage(format!("{what} `{name}` is not known; there are {}", known.join(", ")))
    }

    /// The failure of an operation on the file `path`.
    pub fn io(path: &Path, what: impl fmt::Display) -> Self {
        Self::Io { path: path.to_path_buf(), what: what.to_string() }
    }

    /// The file `path` does not belong to the other inputs.
    pub fn mismatch(path: &Path, what: impl fmt::Display) -> Self {
        Self::Mismatch(format!("{}: {what}", path.display()))
    }

    /// The file `path` holds values that make no sense.
    pub fn bad_data(path: &Path, what: impl fmt::Display) -> Self {
        Self::BadData(format!("{}: {what}", path.display()))
    }

    /// The failure of a library that Fluxion calls.
    pub fn backend(library: &'static str, what: impl fmt::Display) -> Self {
        Self::Backend { library, what: what.to_string() }
    }
}
