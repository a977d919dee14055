//! Motion by alignment of points before and after.

use egomotion::estimate::alignment::{self, Fitting, Form, PointPair};
use egomotion::estimate::{LmedsOptions, Unsolvable};
use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::{Estimate, Robustness};
use crate::arrays;
use crate::error::unsolvable;
use crate::geometry::Motion;

/// A matrix (3, 3) and a translation (3,) that take points `before` (n, 3) to `after` (n, 3), all alike: "rigid" by SVD,
/// or "affine", (22).
#[pyfunction]
#[pyo3(signature = (before, after, *, form = "rigid"))]
pub fn align<'py>(
    py: Python<'py>,
    before: &Bound<'py, PyAny>,
    after: &Bound<'py, PyAny>,
    form: &str,
) -> PyResult<Motion<'py>> {
    let pairs = pairs(before, after)?;
    let sums = alignment::Moments::of_weighted_pairs(pairs.iter().map(|pair| (pair, 1.0)));
    let found = sums.align(self::form(form)?).ok_or_else(|| unsolvable(Unsolvable::Unobservable))?;
    Ok((arrays::square(py, &found.linear)?, PyArray1::from_slice(py, found.translation.as_slice())))
}

/// φ by alignment of points `before` (n, 3) and `after` (n, 3), all alike: "rigid", or "affine", (22) and (25)–(28).
#[pyfunction]
#[pyo3(signature = (before, after, *, form = "rigid", estimator = "ls"))]
pub fn align_phi(
    py: Python<'_>,
    before: &Bound<'_, PyAny>,
    after: &Bound<'_, PyAny>,
    form: &str,
    estimator: &str,
) -> PyResult<Estimate> {
    let (pairs, form) = (pairs(before, after)?, self::form(form)?);
    let fitting = match Robustness::named(estimator)? {
        Robustness::LeastSquares => Fitting::LeastSquares,
        Robustness::Lmeds => Fitting::Lmeds(LmedsOptions::default()),
    };
    let found = py.detach(|| alignment::align(&pairs, form, &fitting));
    Ok(Estimate::of(&found.map_err(unsolvable)?))
}

fn form(name: &str) -> PyResult<Form> {
    match name {
        "rigid" => Ok(Form::Rigid),
        "affine" => Ok(Form::Affine),
        other => Err(PyValueError::new_err(format!("form {other:?} is not known; give 'rigid' or 'affine'"))),
    }
}

fn pairs(before: &Bound<'_, PyAny>, after: &Bound<'_, PyAny>) -> PyResult<Vec<PointPair>> {
    let (before, after) = (arrays::rows::<3>("before", before)?, arrays::rows::<3>("after", after)?);
    arrays::same_length("after", after.len(), before.len())?;
    let pair = |(block, (before, after))| PointPair { before, after, variance: 1.0, block };
    Ok(before.into_iter().zip(after).enumerate().map(pair).collect())
}
