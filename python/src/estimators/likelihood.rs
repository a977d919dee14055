//! Maximum likelihood on tracks of a stereo pair or on its flow, and its Cramér–Rao bound.

use egomotion::estimate::{self, Blocks, StudentT, Unsolvable};
use egomotion::geometry::Twist;
use numpy::PyArray2;
use pyo3::prelude::*;

use super::{Estimate, student_t};
use crate::arrays;
use crate::error::unsolvable;
use crate::geometry::twist;
use crate::observations::{StereoFlows, StereoTracks};
use crate::rig::Rig;

/// What the likelihood is of: finite motion or velocities.
#[derive(FromPyObject)]
pub enum StereoObservations<'py> {
    /// Discrete: (x, y, d) at both times.
    #[pyo3(transparent)]
    Tracks(PyRef<'py, StereoTracks>),
    /// Differential: d and the flow of both cameras.
    #[pyo3(transparent)]
    Flows(PyRef<'py, StereoFlows>),
}

/// φ of maximum likelihood, with the cost Σ eᵀ S⁻¹ e as second value: of StereoTracks in (x, y, d) at both times (discrete),
/// of StereoFlows in d and the flow of both cameras (differential).
///
/// `nu` infinite is the Gaussian; by default robust weights are found from the residuals. With `block_px` the covariance
/// is block-wise, without it the model's.
#[pyfunction]
#[pyo3(signature = (observations, rig, *, start = None, nu = None, block_px = None, iterations = None, tolerance = None))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn maximum_likelihood(
    py: Python<'_>,
    observations: StereoObservations<'_>,
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
    let (rig, blocks) = (&rig.0, blocks.as_ref());
    let found = match &observations {
        StereoObservations::Tracks(tracks) => {
            let tracks = &tracks.0;
            py.detach(|| estimate::maximum_likelihood(tracks, rig, &start, blocks, &kernel))
        }
        StereoObservations::Flows(flows) => {
            let flows = &flows.0;
            py.detach(|| estimate::maximum_likelihood(flows, rig, &start, blocks, &kernel))
        }
    };
    let found = found.map_err(unsolvable)?;
    Ok((Estimate::of(&found.motion), found.cost))
}

/// The Cramér–Rao bound (6, 6) of φ from StereoTracks or StereoFlows, at the motion φ (6,) and their own structure.
#[pyfunction]
pub fn cramer_rao_bound<'py>(
    py: Python<'py>,
    observations: StereoObservations<'py>,
    rig: &Rig,
    phi: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let phi = twist("phi", phi)?;
    let bound = match &observations {
        StereoObservations::Tracks(tracks) => estimate::cramer_rao_bound(&tracks.0, &rig.0, &phi),
        StereoObservations::Flows(flows) => estimate::cramer_rao_bound(&flows.0, &rig.0, &phi),
    };
    arrays::square(py, &bound.ok_or_else(|| unsolvable(Unsolvable::Unobservable))?)
}
