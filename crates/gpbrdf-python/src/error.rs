//! Errors of the core as exceptions of Python.

use std::io;

use gpbrdf_core::Error;
use pyo3::PyErr;
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};

/// The exception for an error, with the error's message: `OSError` or the subclass that fits, for example
/// `FileNotFoundError`, for files that cannot be read or written; `ValueError` for everything else.
pub(crate) fn exception(error: Error) -> PyErr {
    let message = error.to_string();
    match error {
        Error::Io { source, .. } => io::Error::new(source.kind(), message).into(),
        Error::Cancelled => PyKeyboardInterrupt::new_err(message),
        _ => PyValueError::new_err(message),
    }
}

/// A `ValueError` that says what was expected and what was found.
pub(crate) fn wrong(what: &str, expected: &str, found: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(format!("{what}: expected {expected}, found {found}"))
}
