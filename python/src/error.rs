//! Errors of the library as Python exceptions, with the same text.

use fluxion::Error;
use pyo3::exceptions::{PyException, PyOSError, PyValueError};
use pyo3::prelude::*;

pyo3::create_exception!(
    fluxion,
    FluxionError,
    PyException,
    "Input that cannot be used: a scene that is malformed, a layer that is missing, images that do not fit."
);

/// The exception of an error: `ValueError` for arguments, `OSError` for files, `FluxionError` for everything else.
pub fn raised(error: Error) -> PyErr {
    let text = error.to_string();
    let reason = if let Error::Kept { error, .. } = &error { error } else { &error };
    match reason {
        Error::Usage(_) => PyValueError::new_err(text),
        Error::Io { .. } | Error::NotWritten(_) => PyOSError::new_err(text),
        _ => FluxionError::new_err(text),
    }
}
