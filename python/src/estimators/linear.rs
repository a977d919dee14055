//! Estimators on rows of linear equations, and on depth changes whose coefficients are noisy.

use egomotion::estimate::{self, Blocks, LinearFit, LmedsOptions, Row, Unsolvable, Weighting, m_estimate};
use egomotion::geometry::Twist;
use egomotion::pipeline::solve::Solver;
use egomotion::pipeline::{Config, EstimatorKind, Method};
use nalgebra::SVector;
use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::{Estimate, Robustness, student_t};
use crate::arrays;
use crate::error::unsolvable;
use crate::geometry::twist;
use crate::observations::{DepthChanges, StereoFlows};
use crate::rig::Rig;
use crate::rows::{MAX_UNKNOWNS, Rows, with_unknowns};

fn weighting(weighted: bool) -> Weighting {
    if weighted { Weighting::InverseVariance } else { Weighting::Unit }
}

/// What a fit found, with its weights.
fn fitted<const N: usize>(fit: Result<LinearFit<N>, Unsolvable>, rows: &[Row<N>]) -> PyResult<Estimate> {
    let fit = fit.map_err(unsolvable)?;
    Ok(Estimate::of(&fit.estimate(rows)).with_weights(fit.weights))
}

/// θ by least squares; all rows alike as in the paper, or `weighted` by their variances.
#[pyfunction]
#[pyo3(signature = (rows, *, weighted = false))]
pub fn least_squares(py: Python<'_>, rows: &Rows, weighted: bool) -> PyResult<Estimate> {
    py.detach(|| {
        with_unknowns!(rows, N => {
            let rows = rows.to::<N>();
            fitted(estimate::least_squares(&rows, weighting(weighted)), &rows)
        })
    })
}

/// θ by iteratively reweighted least squares with Student's t, from `start` (k,) or least squares.
#[pyfunction]
#[pyo3(signature = (rows, *, start = None, nu = None))]
pub fn irls(py: Python<'_>, rows: &Rows, start: Option<Vec<f64>>, nu: Option<f64>) -> PyResult<Estimate> {
    if let Some(start) = &start {
        arrays::same_length("start", start.len(), rows.unknowns)?;
    }
    let kernel = student_t(nu)?;
    py.detach(|| {
        with_unknowns!(rows, N => {
            let rows = rows.to::<N>();
            let start = match &start {
                Some(start) => SVector::<f64, N>::from_column_slice(start),
                None => estimate::least_squares(&rows, Weighting::InverseVariance).map_err(unsolvable)?.theta,
            };
            fitted(m_estimate(&rows, &start, &kernel), &rows)
        })
    })
}

fn lmeds_options(
    confidence: Option<f64>,
    outliers: Option<f64>,
    cut: Option<f64>,
    reweights: Option<usize>,
    seed: Option<u64>,
) -> PyResult<LmedsOptions> {
    let default = LmedsOptions::default();
    let options = LmedsOptions {
        confidence: confidence.unwrap_or(default.confidence),
        outliers: outliers.unwrap_or(default.outliers),
        cut: cut.unwrap_or(default.cut),
        reweights: reweights.unwrap_or(default.reweights),
        seed: seed.unwrap_or(default.seed),
    };
    // Beyond these the number of subsets (59) runs into the millions.
    let possible = (0.0..=0.9999).contains(&options.confidence) && (0.0..=0.7).contains(&options.outliers);
    if possible && options.cut > 0.0 {
        return Ok(options);
    }
    Err(PyValueError::new_err("confidence must be 0 to 0.9999, outliers 0 to 0.7, cut positive"))
}

/// θ by least median of squares, (58) and (59), then least squares of the inliers.
#[pyfunction]
#[pyo3(signature = (rows, *, weighted = false, confidence = None, outliers = None, cut = None, reweights = None, seed = None))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn lmeds(
    py: Python<'_>,
    rows: &Rows,
    weighted: bool,
    confidence: Option<f64>,
    outliers: Option<f64>,
    cut: Option<f64>,
    reweights: Option<usize>,
    seed: Option<u64>,
) -> PyResult<Estimate> {
    let options = lmeds_options(confidence, outliers, cut, reweights, seed)?;
    py.detach(|| {
        with_unknowns!(rows, N => {
            let rows = rows.to::<N>();
            fitted(estimate::lmeds(&rows, weighting(weighted), &options), &rows)
        })
    })
}

/// The subset of rows whose exact solution has the least median of squared residuals, all rows alike: θ (k,) and that
/// median. `subsets` (m, k) are row numbers.
#[pyfunction]
pub fn lmeds_search<'py>(
    py: Python<'py>,
    rows: &Rows,
    subsets: Vec<Vec<usize>>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, f64)> {
    let n = rows.len();
    if subsets.iter().any(|subset| subset.len() != rows.unknowns || subset.iter().any(|&i| i >= n)) {
        return Err(PyValueError::new_err(format!(
            "subsets must have {} row numbers below {n} each",
            rows.unknowns
        )));
    }
    let found = py.detach(|| {
        with_unknowns!(rows, N => {
            let subsets = subsets.iter().map(|subset| std::array::from_fn::<usize, N, _>(|i| subset[i]));
            estimate::best_subset(&rows.to::<N>(), Weighting::Unit, subsets)
                .map(|found| (found.theta.as_slice().to_vec(), found.median_square))
        })
    });
    let (theta, median_square) = found.ok_or_else(|| unsolvable(Unsolvable::Unobservable))?;
    Ok((PyArray1::from_vec(py, theta), median_square))
}

/// Number of random subsets (59) for confidence P, share of outliers ε and as many rows in each as there are unknowns.
#[pyfunction]
pub fn lmeds_trials(confidence: f64, outliers: f64, unknowns: u32) -> PyResult<usize> {
    let possible = (0.0..1.0).contains(&confidence) && (0.0..1.0).contains(&outliers);
    if possible {
        Ok(estimate::subsets_needed(confidence, outliers, unknowns))
    } else {
        Err(PyValueError::new_err("confidence and outliers must lie in 0 … 1, without 1"))
    }
}

/// The robust standard deviation of residuals from the median of their squares, their number and that of the unknowns.
#[pyfunction]
pub fn robust_scale(median_square: f64, residuals: usize, unknowns: usize) -> f64 {
    estimate::robust_scale(median_square, residuals, unknowns)
}

/// φ by binocular flow in the paper's two steps, (14) then (3): `estimator` "ls", or "lmeds" with defaults.
#[pyfunction]
#[pyo3(signature = (dv, flow, *, estimator = "ls"))]
pub fn two_step(py: Python<'_>, dv: &Rows, flow: &Rows, estimator: &str) -> PyResult<Estimate> {
    if dv.unknowns != MAX_UNKNOWNS || flow.unknowns != MAX_UNKNOWNS {
        return Err(PyValueError::new_err("two_step needs equations in the six components of φ"));
    }
    let robustness = Robustness::named(estimator)?;
    let solve = |rows: &[Row<3>]| match robustness {
        Robustness::Lmeds => estimate::lmeds(rows, Weighting::Unit, &LmedsOptions::default()),
        Robustness::LeastSquares => estimate::least_squares(rows, Weighting::Unit),
    };
    let found = py.detach(|| estimate::two_step(&dv.to(), &flow.to(), solve));
    Ok(Estimate::of(&found.map_err(unsolvable)?))
}

/// φ by binocular flow (13) and image flow (3) solved at once, each row in units of its σ at the motion `start` (6,): the method
/// joint, with `estimator` "irls", "ls" or "lmeds".
#[pyfunction]
#[pyo3(signature = (flows, rig, *, start = None, estimator = "irls", block_px = 48.0))]
pub fn joint(
    py: Python<'_>,
    flows: &StereoFlows,
    rig: &Rig,
    start: Option<&Bound<'_, PyAny>>,
    estimator: &str,
    block_px: f64,
) -> PyResult<Estimate> {
    let start = start.map_or_else(|| Ok(Twist::zero()), |start| twist("start", start))?;
    let estimator = match estimator {
        "irls" => EstimatorKind::Irls,
        "ls" => EstimatorKind::Ls,
        "lmeds" => EstimatorKind::Lmeds,
        other => {
            let words = format!("estimator {other:?} is not known; give 'irls', 'ls' or 'lmeds'");
            return Err(PyValueError::new_err(words));
        }
    };
    let config = Config { method: Method::Joint, estimator, block_px, ..Config::default() };
    let found = py.detach(|| Solver::new(&rig.0, &start, &config).joint(&flows.0));
    Ok(Estimate::of(&found.map_err(unsolvable)?))
}

/// φ from depth changes with noisy gradients: DCCE without its bias, from `start` (6,).
#[pyfunction]
#[pyo3(signature = (changes, rig, *, start = None, block_px = 48.0))]
pub fn errors_in_variables(
    py: Python<'_>,
    changes: &DepthChanges,
    rig: &Rig,
    start: Option<&Bound<'_, PyAny>>,
    block_px: f64,
) -> PyResult<Estimate> {
    let start = start.map_or_else(|| Ok(Twist::zero()), |start| twist("start", start))?;
    let blocks = Blocks::tiling(&rig.0, block_px);
    let found = py.detach(|| estimate::errors_in_variables(&changes.0, &rig.0, &start, &blocks));
    Ok(Estimate::of(&found.map_err(unsolvable)?))
}
