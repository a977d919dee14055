//! Twists φ and rigid motions, as vectors and matrices.

use egomotion::geometry::{Gaussian, RigidMotion, Twist};
use nalgebra::{Matrix3, Matrix6, Vector6};
use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays;

/// A rotation (3, 3) and a translation (3,).
pub type Motion<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

pub fn twist(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Twist> {
    Ok(Twist::from_vector(&arrays::one::<6>(name, argument)?))
}

pub fn phi<'py>(py: Python<'py>, twist: &Twist) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, twist.vector().as_slice())
}

/// R (3, 3) and T (3,) as arrays.
pub fn pose<'py>(py: Python<'py>, motion: &RigidMotion) -> PyResult<Motion<'py>> {
    Ok((arrays::square(py, &motion.rotation)?, PyArray1::from_slice(py, motion.translation.as_slice())))
}

/// R and T of a motion; R must be a rotation.
pub fn motion(rotation: &Bound<'_, PyAny>, translation: &Bound<'_, PyAny>) -> PyResult<RigidMotion> {
    let motion = any_motion(rotation, translation)?;
    let r = &motion.rotation;
    let off = (r.transpose() * r - Matrix3::identity()).amax();
    if off < 1e-6 && r.determinant() > 0.0 {
        return Ok(motion);
    }
    Err(PyValueError::new_err(
        "rotation is no rotation matrix: its columns are not at right angles, of length 1",
    ))
}

fn any_motion(rotation: &Bound<'_, PyAny>, translation: &Bound<'_, PyAny>) -> PyResult<RigidMotion> {
    Ok(RigidMotion {
        rotation: arrays::matrix::<3>("rotation", rotation)?,
        translation: arrays::one::<3>("translation", translation)?,
    })
}

/// R (3, 3) and T (3,) of exp(φ dt): where the scene is after `dt` with velocity φ (6,) = (t, Ω), (24) and (25).
#[pyfunction]
#[pyo3(signature = (phi, dt = 1.0))]
pub fn exp<'py>(py: Python<'py>, phi: &Bound<'py, PyAny>, dt: f64) -> PyResult<Motion<'py>> {
    pose(py, &twist("phi", phi)?.scaled(dt).exp())
}

/// φ (6,) of a rotation (3, 3) and a translation (3,), with exp(φ) = (R, T).
#[pyfunction]
pub fn log<'py>(
    py: Python<'py>,
    rotation: &Bound<'py, PyAny>,
    translation: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    Ok(phi(py, &motion(rotation, translation)?.log()))
}

/// φ (6,) by the instantaneous form (27), of any matrix (3, 3) and translation (3,).
#[pyfunction]
pub fn instantaneous<'py>(
    py: Python<'py>,
    rotation: &Bound<'py, PyAny>,
    translation: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    Ok(phi(py, &any_motion(rotation, translation)?.instantaneous()))
}

/// R (3, 3) and U (3, 3) of (25) and (26) after `dt`: T = U t.
#[pyfunction]
#[pyo3(signature = (phi, dt = 1.0))]
pub fn rotation_and_u<'py>(
    py: Python<'py>,
    phi: &Bound<'py, PyAny>,
    dt: f64,
) -> PyResult<arrays::ArrayPair<'py, f64>> {
    let (r, u) = twist("phi", phi)?.rotation_and_u(dt);
    Ok((arrays::square(py, &r)?, arrays::square(py, &u)?))
}

/// The same motion φ (6,) as a camera at `centre` (3,) sees it.
#[pyfunction]
pub fn seen_from<'py>(
    py: Python<'py>,
    phi: &Bound<'py, PyAny>,
    centre: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let centre = arrays::one::<3>("centre", centre)?;
    Ok(self::phi(py, &twist("phi", phi)?.seen_from(&centre)))
}

/// Velocity t + Ω × P (n, 3) of points P (n, 3) under φ (6,), (1).
#[pyfunction]
pub fn velocity<'py>(
    py: Python<'py>,
    phi: &Bound<'py, PyAny>,
    points: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (phi, points) = (twist("phi", phi)?, arrays::rows::<3>("points", points)?);
    arrays::table(py, points.iter().map(|p| phi.velocity(p)))
}

/// Image flow (n, 2) in pixels of points (x, y, Z) (n, 3), x and y in pixels and Z in metres, under φ (6,), (3).
#[pyfunction]
pub fn image_flow<'py>(
    py: Python<'py>,
    phi: &Bound<'py, PyAny>,
    xy_depth: &Bound<'py, PyAny>,
    focal_px: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (phi, points) = (twist("phi", phi)?, arrays::rows::<3>("xy_depth", xy_depth)?);
    arrays::table(py, points.iter().map(|p| egomotion::geometry::image_flow(&phi, p.x, p.y, p.z, focal_px)))
}

/// Image velocity (n, 2) in pixels of points (X, Y, Z) (n, 3) that move with velocities (n, 3), both in metres, (2).
#[pyfunction]
pub fn image_velocity<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    velocities: &Bound<'py, PyAny>,
    focal_px: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (points, velocities) =
        (arrays::rows::<3>("points", points)?, arrays::rows::<3>("velocities", velocities)?);
    arrays::same_length("velocities", velocities.len(), points.len())?;
    let both = points.iter().zip(&velocities);
    arrays::table(py, both.map(|(p, v)| egomotion::geometry::image_velocity(p, v, focal_px)))
}

/// Most quantities that [`propagate_covariance`] takes and gives: the six components of φ.
const MAX_QUANTITIES: usize = 6;

/// Covariance (m, m) of m quantities whose Jacobian (m, n) by n quantities with covariance (n, n) is known, J Σ Jᵀ (30);
/// m and n are at most 6.
#[pyfunction]
pub fn propagate_covariance<'py>(
    py: Python<'py>,
    jacobian: &Bound<'py, PyAny>,
    covariance: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let ((m, n), jacobian) = small_matrix("jacobian", jacobian)?;
    let (shape, cov) = small_matrix("covariance", covariance)?;
    if shape != (n, n) {
        let words =
            format!("covariance has shape {shape:?}; give ({n}, {n}), as the jacobian has {n} columns");
        return Err(PyValueError::new_err(words));
    }
    // Beyond their shape both are zero, and so nothing is added.
    let found = Gaussian { mean: Vector6::zeros(), cov }.propagate(Vector6::zeros(), &jacobian);
    let corner = (0..m * m).map(|i| found.cov[(i / m, i % m)]);
    PyArray1::from_iter(py, corner).reshape([m, m])
}

/// The shape of a matrix of at most six rows and columns, and its numbers, followed by zeros.
fn small_matrix(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<((usize, usize), Matrix6<f64>)> {
    arrays::numbers(name, argument, |shape, values| match *shape {
        [rows @ 1..=MAX_QUANTITIES, columns @ 1..=MAX_QUANTITIES] => {
            let at = |i: usize, j: usize| if i < rows && j < columns { values[i * columns + j] } else { 0.0 };
            Ok(((rows, columns), Matrix6::from_fn(at)))
        }
        _ => {
            let words = format!(
                "{name} has shape {shape:?}; give a matrix of at most {MAX_QUANTITIES} rows and columns"
            );
            Err(PyValueError::new_err(words))
        }
    })
}

/// Variance of a quantity that is rounded to multiples of `step`, step²/12, (52).
#[pyfunction]
pub fn rounding_variance(step: f64) -> f64 {
    egomotion::geometry::rounding_variance(step)
}
