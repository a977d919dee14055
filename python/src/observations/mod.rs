//! The four kinds of observation, many points at a time: depth velocity, its variance, and equations for φ.

use egomotion::constrain::LinearConstraint;
use egomotion::estimate::Blocks;
use egomotion::geometry::{Gaussian, Twist};
use egomotion::motion::{DepthVelocity, depth_velocity as vz};
use nalgebra::SVector;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays;
use crate::geometry::twist;
use crate::rig::Rig;
use crate::rows::Rows;

mod depth;
mod stereo;

pub use depth::{DepthChanges, DepthFlows, DepthTracks};
pub use stereo::{StereoFlows, StereoTracks};

/// One number for each point.
type Numbers<'py> = Bound<'py, PyArray1<f64>>;

/// A number of every observation, on all threads and without the interpreter.
fn each<'py, T: Sync>(py: Python<'py>, all: &[T], value: impl Fn(&T) -> f64 + Sync + Send) -> Numbers<'py> {
    let values = py.detach(|| all.par_iter().with_min_len(1024).map(value).collect());
    PyArray1::from_vec(py, values)
}

/// VZ and its variance of every observation.
fn velocities<'py, T: Sync>(
    py: Python<'py>,
    all: &[T],
    velocity: impl Fn(&T) -> DepthVelocity + Sync + Send,
) -> (Numbers<'py>, Numbers<'py>) {
    let (values, variances) = py.detach(|| {
        let both = all.par_iter().with_min_len(1024).map(|one| velocity(one).vz());
        both.map(|vz| (vz.value(), vz.variance())).unzip()
    });
    (PyArray1::from_vec(py, values), PyArray1::from_vec(py, variances))
}

/// The coefficients (53) of every observation, (n, 2).
fn coefficients<'py, T: Sync>(
    py: Python<'py>,
    all: &[T],
    both: impl Fn(&T) -> (f64, f64) + Sync + Send,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let values: Vec<_> = py.detach(|| all.par_iter().map(both).collect());
    arrays::table(py, values.into_iter().map(|(d, v)| SVector::from([d, v])))
}

/// Measured vectors with their covariances: (n, N) with variances (N,), (n, N) or covariances (n, N, N).
fn gaussians<const N: usize>(
    name: &str,
    mean: &Bound<'_, PyAny>,
    cov: &Bound<'_, PyAny>,
) -> PyResult<Vec<Gaussian<N>>> {
    let mean = arrays::rows::<N>(name, mean)?;
    let cov = arrays::covariances::<N>(&format!("{name}_cov"), cov, mean.len())?;
    Ok(mean.into_iter().zip(cov).map(|(mean, cov)| Gaussian { mean, cov }).collect())
}

/// Name, means and covariances of one measured vector at every point.
type Measured<'a, 'py> = (&'a str, &'a Bound<'py, PyAny>, &'a Bound<'py, PyAny>);

/// Points at places (x, y), each with two measured vectors.
fn points<const A: usize, const B: usize, T>(
    xy: &Bound<'_, PyAny>,
    first: Measured<'_, '_>,
    second: Measured<'_, '_>,
    point: impl Fn(f64, f64, Gaussian<A>, Gaussian<B>) -> T,
) -> PyResult<Vec<T>> {
    let one = gaussians(first.0, first.1, first.2)?;
    let other = gaussians(second.0, second.1, second.2)?;
    let xy = arrays::rows::<2>("xy", xy)?;
    arrays::same_length(second.0, other.len(), one.len())?;
    arrays::same_length("xy", xy.len(), one.len())?;
    let all = xy.into_iter().zip(one).zip(other);
    Ok(all.map(|((xy, one), other)| point(xy.x, xy.y, one, other)).collect())
}

/// The motion at which equations are weighted; none by default.
fn at_motion(at: Option<&Bound<'_, PyAny>>) -> PyResult<Twist> {
    at.map_or_else(|| Ok(Twist::zero()), |at| twist("at", at))
}

/// Equations of observations at (x, y); neighbours within `block_px` share a block, or each has its own.
fn equations<T: Sync>(
    py: Python<'_>,
    all: &[T],
    rig: &Rig,
    block_px: Option<f64>,
    place: impl Fn(&T) -> (f64, f64) + Sync + Send,
    constraints: impl Fn(&T) -> Vec<LinearConstraint> + Sync + Send,
) -> Rows {
    let blocks = block_px.map(|size| Blocks::tiling(&rig.0, size));
    let rows = py.detach(|| {
        let rows = all.par_iter().enumerate().with_min_len(1024).flat_map_iter(|(i, one)| {
            let (x, y) = place(one);
            let block = blocks.map_or(i, |blocks| blocks.index(x, y));
            constraints(one)
                .into_iter()
                .map(move |constraint| (constraint.row(), constraint.rate, constraint.sigma, block))
        });
        rows.collect::<Vec<_>>()
    });
    Rows::of_six(rows)
}

/// The exact change of depth (n,) by (6): depths Z (n,) in metres at t, the disparity map (H, W) after, places (u, v) (n, 2) in
/// px where the points have moved to; NaN where the map has no value. Disparity is interpolated, not Z.
#[pyfunction]
pub fn exact_depth_change<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    disparity_after: &Bound<'py, PyAny>,
    uv: &Bound<'py, PyAny>,
    rig: &Rig,
) -> PyResult<Numbers<'py>> {
    let (z, after, uv) = (
        arrays::vector("depth", depth)?,
        arrays::field("disparity_after", disparity_after)?,
        arrays::rows::<2>("uv", uv)?,
    );
    arrays::same_length("uv", uv.len(), z.len())?;
    let change =
        z.iter().zip(&uv).map(|(&z, uv)| vz::exact_change(z, &after, uv.x, uv.y, &rig.0).unwrap_or(f64::NAN));
    Ok(PyArray1::from_iter(py, change))
}

/// The smallest change of depth (n,) in metres that a step of disparity in pixels shows at disparities (n,) in pixels, (51).
#[pyfunction]
pub fn smallest_depth_change<'py>(
    py: Python<'py>,
    disparity: &Bound<'py, PyAny>,
    step_px: f64,
    rig: &Rig,
) -> PyResult<Numbers<'py>> {
    let bf = rig.0.depth_disparity_product();
    Ok(PyArray1::from_iter(
        py,
        arrays::vector("disparity", disparity)?.into_iter().map(|d| vz::smallest_change(d, step_px, bf)),
    ))
}
