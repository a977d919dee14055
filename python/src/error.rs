//! Errors of the library as exceptions, in the same words.

use std::fmt::Display;

use egomotion::estimate;
use egomotion_io::OptionsError;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;

create_exception!(egomotion, ReadError, PyException, "A recording or a file cannot be read.");
create_exception!(egomotion, Unsolvable, PyException, "The equations have no answer.");

/// A file that cannot be read or written.
pub fn read(error: impl Display) -> PyErr {
    ReadError::new_err(error.to_string())
}

/// Equations without an answer.
pub fn unsolvable(error: estimate::Unsolvable) -> PyErr {
    Unsolvable::new_err(error.to_string())
}

/// A value that has no meaning.
pub fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A choice that has no meaning is a wrong value.
pub fn choice(error: OptionsError) -> PyErr {
    match error {
        OptionsError::Invalid(words) => value(words),
        OptionsError::File(error) => read(error),
    }
}
