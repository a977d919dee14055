//! Errors of the library as exceptions, in the same words.

use std::fmt::Display;

use egomotion::estimate;
use egomotion_io::OptionsError;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;

create_exception!(egomotion, FileError, PyException, "A recording or a file cannot be read or written.");
create_exception!(egomotion, Unsolvable, PyException, "The equations have no answer.");

/// A file that cannot be read or written.
pub fn file(error: impl Display) -> PyErr {
    FileError::new_err(error.to_string())
}

/// Equations without an answer.
pub fn unsolvable(error: estimate::Unsolvable) -> PyErr {
    Unsolvable::new_err(error.to_string())
}

/// A value that has no meaning.
pub fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Options that have no meaning are a wrong value; a file that they need may be at fault too.
pub fn options(error: OptionsError) -> PyErr {
    match error {
        OptionsError::Invalid(words) => value(words),
        OptionsError::File(error) => file(error),
    }
}
