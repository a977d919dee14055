//! What an estimator answers.

use std::any::Any;

use egomotion::estimate::{self, MotionEstimate};
use nalgebra::SVector;
use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays;

/// An estimate of k unknowns: its value, its covariance, and what could not be determined.
#[pyclass(module = "egomotion", frozen)]
#[derive(Clone)]
pub struct Estimate {
    theta: Vec<f64>,
    covariance: Vec<f64>,
    observed: Vec<bool>,
    undetermined: Vec<Vec<f64>>,
    words: Vec<String>,
    rows: usize,
    inliers: usize,
    residual_scale: f64,
    weights: Option<Vec<f64>>,
    /// The same, if it is one of six unknowns.
    motion: Option<MotionEstimate>,
}

impl Estimate {
    pub fn of<const N: usize>(found: &estimate::Estimate<N>) -> Self {
        Self {
            theta: found.theta.mean.as_slice().to_vec(),
            covariance: found.theta.cov.transpose().as_slice().to_vec(),
            observed: found.observed.to_vec(),
            undetermined: found.undetermined.directions().iter().map(|d| d.as_slice().to_vec()).collect(),
            words: words(found.undetermined.directions()),
            rows: found.rows,
            inliers: found.inliers,
            residual_scale: found.residual_scale,
            weights: None,
            motion: (found as &dyn Any).downcast_ref::<MotionEstimate>().copied(),
        }
    }

    pub fn with_weights(self, weights: Vec<f64>) -> Self {
        Self { weights: Some(weights), ..self }
    }
}

/// Of six unknowns, which are a motion, the directions in words.
fn words<const N: usize>(directions: &[SVector<f64, N>]) -> Vec<String> {
    if N != 6 || directions.is_empty() {
        return Vec::new();
    }
    let motions =
        directions.iter().map(|direction| SVector::<f64, 6>::from_column_slice(direction.as_slice()));
    let free = estimate::UndeterminedDirections::<6>::spanned(motions, 1e-3);
    free.motions().iter().map(ToString::to_string).collect()
}

#[pymethods]
impl Estimate {
    /// The estimate (k,); NaN where it is not determined. Of a motion φ = (tX, tY, tZ, ΩX, ΩY, ΩZ), metres and radians.
    #[getter]
    fn theta<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.theta)
    }

    /// Its covariance (k, k); infinite variance where it is not determined.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let k = self.theta.len();
        PyArray1::from_slice(py, &self.covariance).reshape([k, k])
    }

    /// Standard deviations (k,).
    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let k = self.theta.len();
        PyArray1::from_iter(py, (0..k).map(|i| self.covariance[i * (k + 1)].sqrt()))
    }

    /// Which components (k,) are determined.
    #[getter]
    fn observed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_slice(py, &self.observed)
    }

    /// Directions (m, k) that are not determined; m is mostly 0.
    #[getter]
    fn undetermined<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat: Vec<f64> = self.undetermined.concat();
        PyArray1::from_vec(py, flat).reshape([self.undetermined.len(), self.theta.len()])
    }

    /// Of a motion, the directions that are not determined, in words.
    #[getter]
    fn undetermined_words(&self) -> Vec<String> {
        self.words.clone()
    }

    /// Equations or observations that went in.
    #[getter]
    fn rows(&self) -> usize {
        self.rows
    }

    /// Those that were kept.
    #[getter]
    fn inliers(&self) -> usize {
        self.inliers
    }

    /// Scale of the residuals: in units of each row's σ where rows are weighted, else in the rows' own unit.
    #[getter]
    fn residual_scale(&self) -> f64 {
        self.residual_scale
    }

    /// The weight (n,) of each row, 0 for a rejected one; None where the estimator has none to tell.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.weights.as_deref().map(|weights| PyArray1::from_slice(py, weights))
    }

    /// The same motion φ and its covariance for a parallel camera centred at `centre` (3,) in metres, (4): the right camera of
    /// a rig is at (baseline, 0, 0), the cyclopean one half-way. An estimate of other unknowns than φ is refused.
    fn seen_from(&self, centre: &Bound<'_, PyAny>) -> PyResult<Self> {
        let centre = arrays::one::<3>("centre", centre)?;
        let motion = self.motion.as_ref().ok_or_else(|| {
            let words = format!("an estimate of {} unknowns is no motion; give one of six", self.theta.len());
            PyValueError::new_err(words)
        })?;
        Ok(Self { weights: self.weights.clone(), ..Self::of(&motion.seen_from(&centre)) })
    }

    fn __repr__(&self) -> String {
        let k = self.theta.len();
        let parts =
            (0..k).map(|i| format!("{:.5e} ± {:.1e}", self.theta[i], self.covariance[i * (k + 1)].sqrt()));
        format!("Estimate({})", parts.collect::<Vec<_>>().join(", "))
    }
}
