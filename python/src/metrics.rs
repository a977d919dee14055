//! How wrong estimates are, in the measures of the paper's section 7.

use egomotion::metrics::SectionSeven;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;

/// ERM, EAM and STD of estimates (n,) against truths (n,), as the paper's section 7 has them; NaN counts for nothing.
///
/// In percent of the truth: `erm_signed` (Tables 3 and 6), `erm_abs`, `erm_median`, `std_percent`, over points whose |truth|
/// is at least 10 % of its 99th percentile; None where there are none. In the unit of the values: `eam`, `eam_median`, `std`.
/// `count` and `relative_count` are how many points counted.
#[pyfunction]
pub fn section_seven<'py>(
    py: Python<'py>,
    estimate: &Bound<'py, PyAny>,
    truth: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let (estimate, truth) = (arrays::vector("estimate", estimate)?, arrays::vector("truth", truth)?);
    arrays::same_length("truth", truth.len(), estimate.len())?;
    let pairs: Vec<(f64, f64)> = estimate.into_iter().zip(truth).collect();
    let found = SectionSeven::of(&pairs)
        .ok_or_else(|| PyValueError::new_err("no point has both an estimate and a truth; give some"))?;
    let figures = PyDict::new(py);
    figures.set_item("erm_signed", found.erm_signed_percent)?;
    figures.set_item("erm_abs", found.erm_abs_percent)?;
    figures.set_item("erm_median", found.erm_median_percent)?;
    figures.set_item("std_percent", found.std_percent)?;
    figures.set_item("eam", found.eam)?;
    figures.set_item("eam_median", found.eam_median)?;
    figures.set_item("std", found.std)?;
    figures.set_item("count", found.count)?;
    figures.set_item("relative_count", found.relative_count)?;
    Ok(figures)
}
