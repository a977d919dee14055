//! Doubts about a pipeline's answers, as a `UserWarning`.

use std::ffi::CString;

use egomotion::pipeline::FrameMotion;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

/// Whether a pipeline has said that its method does not hold on the data: it says so once.
#[derive(Default)]
pub struct Doubt(bool);

impl Doubt {
    /// Warn of the first answer that tracked corners contradict.
    pub fn of(&mut self, py: Python<'_>, answer: &FrameMotion) -> PyResult<()> {
        let Some(contradiction) = answer.contradiction.filter(|_| !self.0) else { return Ok(()) };
        self.0 = true;
        let words = format!(
            "frame {}: {contradiction}; the method may not hold on these data, see `contradiction` of each answer",
            answer.frame
        );
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(words)?, 1)
    }
}
