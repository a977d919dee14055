//! Maximum likelihood on tracks of a stereo pair, and its Cramér–Rao bound.

use egomotion::estimate::{self, Blocks, StudentT, Unsolvable};
use egomotion::geometry::Twist;
use numpy::PyArray2;
use pyo3::prelude::*;

use super::{Estimate, student_t};
use crate::arrays;
use crate::error::unsolvable;
use crate::geometry::twist;
use crate::observations::StereoTracks;
use crate::rig::Rig;

/// φ of maximum likelihood in (x, y, d) at both times, with the cost Σ eᵀ S⁻¹ e as second value.
///
/// `nu` infinite is the Gaussian; by default robust weights are found from the residuals. With `block_px` the covariance
/// is block-wise, without it the model's.
#[pyfunction]
#[pyo3(signature = (tracks, rig, *, start = None, nu = None, block_px = None, iterations = None, tolerance = None))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn maximum_likelihood(
    py: Python<'_>,
    tracks: &StereoTracks,
    rig: &Rig,
    start: Option<&Bound<'_, PyAny>>,
    nu: Option<f64>,
    block_px: Option<f64>,
    iterations: Option<usize>,
    tolerance: Option<f64>,
) -> PyResult<(Estimate, f64)> {
    let default = student_t(nu)?;
    let kernel = StudentT {
        iterations: iterations.unwrap_or(default.iterations),
        tolerance: tolerance.unwrap_or(default.tolerance),
        ..default
    };
    let start = start.map_or_else(|| Ok(Twist::zero()), |start| twist("start", start))?;
    let blocks = block_px.map(|size| Blocks::tiling(&rig.0, size));
    let found =
        py.detach(|| estimate::maximum_likelihood(&tracks.0, &rig.0, &start, blocks.as_ref(), &kernel));
    let found = found.map_err(unsolvable)?;
    Ok((Estimate::of(&found.motion), found.cost))
}

/// The Cramér–Rao bound (6, 6) of φ from tracks, at the motion φ (6,) and the tracks' own structure.
#[pyfunction]
pub fn cramer_rao_bound<'py>(
    py: Python<'py>,
    tracks: &StereoTracks,
    rig: &Rig,
    phi: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let phi = twist("phi", phi)?;
    let bound = estimate::cramer_rao_bound(&tracks.0, &rig.0, &phi);
    arrays::square(py, &bound.ok_or_else(|| unsolvable(Unsolvable::Unobservable))?)
}
