//! Twists φ and rigid motions, as vectors and matrices.

use egomotion::geometry::{RigidMotion, Twist};
use nalgebra::Matrix3;
use numpy::{PyArray1, PyArray2};
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
