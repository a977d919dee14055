//! What the motion of points means for the time until they are met.

use egomotion::geometry::Gaussian;
use egomotion::motion;
use nalgebra::{Matrix6, SVector, Vector3};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays;
use crate::geometry::twist;

/// One number for each point.
type Numbers<'py> = Bound<'py, PyArray1<f64>>;
/// One interval for each point.
type Intervals<'py> = Bound<'py, PyArray2<f64>>;

/// Scaled depth −Z/tZ (n,) in seconds of points (X, Y, Z) (n, 3) in metres, and its 95 % interval (n, 2): "time to impact"
/// by the translation alone (Colombo and Del Bimbo), NaN where the translation does not approach.
///
/// φ (6,) is per interval of dt_s seconds; depth_sigma (n,) in metres is that of Z along the ray; both are exact by default.
#[pyfunction]
#[pyo3(signature = (points, phi, *, depth_sigma = None, phi_cov = None, dt_s = 1.0))]
pub fn scaled_depth<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    phi: &Bound<'py, PyAny>,
    depth_sigma: Option<&Bound<'py, PyAny>>,
    phi_cov: Option<&Bound<'py, PyAny>>,
    dt_s: f64,
) -> PyResult<(Numbers<'py>, Intervals<'py>)> {
    let (points, phi) = (uncertain_points(points, depth_sigma)?, gaussian(phi, phi_cov)?);
    let times: Vec<_> =
        points.iter().map(|(point, variance)| motion::scaled_depth(point, *variance, &phi, dt_s)).collect();
    let seconds = times.iter().map(|time| time.and_then(|time| time.seconds()).unwrap_or(f64::NAN));
    let interval = |time: &Option<motion::TimeToImpact>| {
        let (low, high) = time.and_then(|time| time.interval95_s()).unwrap_or((f64::NAN, f64::NAN));
        SVector::from([low, high])
    };
    Ok((PyArray1::from_iter(py, seconds), arrays::table(py, times.iter().map(interval))?))
}

/// Scaled depth less the time to impact −Z/VZ (n,) in seconds, and its σ (n,): what leaving rotation out makes of the time.
///
/// Arguments are those of scaled_depth; NaN where the translation or the point does not approach.
#[pyfunction]
#[pyo3(signature = (points, phi, *, depth_sigma = None, phi_cov = None, dt_s = 1.0))]
pub fn rotation_left_out<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    phi: &Bound<'py, PyAny>,
    depth_sigma: Option<&Bound<'py, PyAny>>,
    phi_cov: Option<&Bound<'py, PyAny>>,
    dt_s: f64,
) -> PyResult<(Numbers<'py>, Numbers<'py>)> {
    let (points, phi) = (uncertain_points(points, depth_sigma)?, gaussian(phi, phi_cov)?);
    let errors = points.iter().map(|(point, variance)| {
        let error = motion::rotation_left_out(point, *variance, &phi, dt_s);
        error.map_or((f64::NAN, f64::NAN), |error| (error.value(), error.sigma(0)))
    });
    let (values, sigmas): (Vec<f64>, Vec<f64>) = errors.unzip();
    Ok((PyArray1::from_vec(py, values), PyArray1::from_vec(py, sigmas)))
}

/// Points with the variance of their Z.
fn uncertain_points(
    points: &Bound<'_, PyAny>,
    depth_sigma: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<(Vector3<f64>, f64)>> {
    let points = arrays::rows::<3>("points", points)?;
    let exact = || Ok(vec![0.0; points.len()]);
    let sigma = depth_sigma.map_or_else(exact, |sigma| arrays::vector("depth_sigma", sigma))?;
    arrays::same_length("depth_sigma", sigma.len(), points.len())?;
    Ok(points.into_iter().zip(sigma).map(|(point, sigma)| (point, sigma * sigma)).collect())
}

/// φ with its covariance (6, 6), exact without one.
fn gaussian(phi: &Bound<'_, PyAny>, cov: Option<&Bound<'_, PyAny>>) -> PyResult<Gaussian<6>> {
    let cov = cov.map_or_else(|| Ok(Matrix6::zeros()), |cov| arrays::matrix::<6>("phi_cov", cov))?;
    Ok(Gaussian { mean: twist("phi", phi)?.vector(), cov })
}
