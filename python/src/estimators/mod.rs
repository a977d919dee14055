//! Estimators, one file for each family of the library, and what they answer.

mod alignment;
mod estimate;
mod likelihood;
mod linear;

use egomotion::estimate::StudentT;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

pub use alignment::{align, align_phi};
pub use estimate::Estimate;
pub use likelihood::{cramer_rao_bound, maximum_likelihood};
pub use linear::{
    errors_in_variables, irls, joint, least_squares, lmeds, lmeds_search, lmeds_trials, robust_scale,
    two_step,
};

/// Student's t with `nu` degrees of freedom; by default that of the pipeline.
fn student_t(nu: Option<f64>) -> PyResult<StudentT> {
    let default = StudentT::default();
    match nu {
        None => Ok(default),
        Some(nu) if nu > 0.0 => Ok(StudentT { nu, fitted: false, ..default }),
        Some(nu) => Err(PyValueError::new_err(format!("nu is {nu}; give a positive number"))),
    }
}

/// The least-squares or the least-median-of-squares form of an estimator.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Robustness {
    LeastSquares,
    Lmeds,
}

impl Robustness {
    /// By the name that Python gives it.
    fn named(estimator: &str) -> PyResult<Self> {
        match estimator {
            "ls" => Ok(Self::LeastSquares),
            "lmeds" => Ok(Self::Lmeds),
            other => {
                let words = format!("estimator {other:?} is not known; give 'ls' or 'lmeds'");
                Err(PyValueError::new_err(words))
            }
        }
    }
}
