//! The four kinds of observation, many points at a time: depth velocity, its variance, and equations for φ.

use egomotion::constrain::{LinearConstraint, binocular_flow, dcce, image_flow};
use egomotion::estimate::Blocks;
use egomotion::geometry::{Gaussian, Twist};
use egomotion::motion::DepthVelocity;
use egomotion::motion::depth_velocity as vz;
use egomotion::observe::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};
use nalgebra::SVector;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays;
use crate::geometry::twist;
use crate::rig::Rig;
use crate::rows::Rows;

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

/// Places (x, y), as many as there are points.
fn places(xy: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<SVector<f64, 2>>> {
    let xy = arrays::rows::<2>("xy", xy)?;
    arrays::same_length("xy", xy.len(), n)?;
    Ok(xy)
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
    let blocks = block_px.map(|size| Blocks::over(&rig.0, size));
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

/// Change of depth at points: what the depth change constraint needs, from depth itself.
#[pyclass(module = "egomotion", frozen)]
pub struct DepthChanges(pub Vec<DepthChange>);

#[pymethods]
impl DepthChanges {
    /// At (x, y) (n, 2) px: depth (n, 4) = Z, Zx, Zy (m/px), Zt (m/interval), and flow (n, 2) in px.
    #[new]
    #[pyo3(signature = (xy, depth, flow, depth_cov, flow_cov))]
    fn new(
        xy: &Bound<'_, PyAny>,
        depth: &Bound<'_, PyAny>,
        flow: &Bound<'_, PyAny>,
        depth_cov: &Bound<'_, PyAny>,
        flow_cov: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let depth = gaussians::<4>("depth", depth, depth_cov)?;
        let flow = gaussians::<2>("flow", flow, flow_cov)?;
        arrays::same_length("flow", flow.len(), depth.len())?;
        let xy = places(xy, depth.len())?;
        let change = |((xy, depth), flow): ((SVector<f64, 2>, _), _)| DepthChange {
            x_px: xy.x,
            y_px: xy.y,
            depth,
            flow,
        };
        Ok(Self(xy.into_iter().zip(depth).zip(flow).map(change).collect()))
    }

    /// VZ (n,) in metres per interval and its variance (n,): (7) with (39c), or (17) with (47c).
    fn depth_velocity<'py>(&self, py: Python<'py>) -> (Numbers<'py>, Numbers<'py>) {
        velocities(py, &self.0, vz::dcce)
    }

    /// Variance (n,) of VZ with the product of the two noises.
    fn variance_with_product<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        each(py, &self.0, vz::dcce_variance_with_product)
    }

    /// Z, Zx, Zy, Zt (n, 4).
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|change| change.depth.mean))
    }

    /// Their covariances (n, 4, 4).
    #[getter]
    fn depth_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|change| change.depth.cov))
    }

    /// Equations (11), weighted at the motion `at`.
    #[pyo3(signature = (rig, *, at = None, block_px = None))]
    fn equations(
        &self,
        py: Python<'_>,
        rig: &Rig,
        at: Option<&Bound<'_, PyAny>>,
        block_px: Option<f64>,
    ) -> PyResult<Rows> {
        let (at, f) = (at_motion(at)?, rig.0.focal_px);
        let place = |change: &DepthChange| (change.x_px, change.y_px);
        Ok(equations(py, &self.0, rig, block_px, place, |change| vec![dcce::constraint(change, f, &at)]))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

/// Disparity with its derivatives, and flow, at points.
#[pyclass(module = "egomotion", frozen)]
pub struct DepthFlows(pub Vec<DepthFlow>);

#[pymethods]
impl DepthFlows {
    /// At (x, y) (n, 2) px: disparity (n, 4) = d, dx, dy, dt, and flow (n, 2), in px.
    #[new]
    fn new(
        xy: &Bound<'_, PyAny>,
        disparity: &Bound<'_, PyAny>,
        flow: &Bound<'_, PyAny>,
        disparity_cov: &Bound<'_, PyAny>,
        flow_cov: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let disparity = gaussians::<4>("disparity", disparity, disparity_cov)?;
        let flow = gaussians::<2>("flow", flow, flow_cov)?;
        arrays::same_length("flow", flow.len(), disparity.len())?;
        let xy = places(xy, disparity.len())?;
        let all = xy.into_iter().zip(disparity).zip(flow);
        let flow = all.map(|((xy, disparity), flow)| DepthFlow { x_px: xy.x, y_px: xy.y, disparity, flow });
        Ok(Self(flow.collect()))
    }

    /// Change of depth at every point.
    fn depth_change(&self, py: Python<'_>, rig: &Rig) -> DepthChanges {
        let bf = rig.0.depth_disparity_product();
        DepthChanges(py.detach(|| self.0.par_iter().map(|flow| flow.depth_change(bf)).collect()))
    }

    /// VZ (n,), (7), and its variance (n,), (39c).
    fn depth_velocity<'py>(&self, py: Python<'py>, rig: &Rig) -> (Numbers<'py>, Numbers<'py>) {
        let bf = rig.0.depth_disparity_product();
        velocities(py, &self.0, |flow| vz::dcce(&flow.depth_change(bf)))
    }

    /// Variance (n,) of (7) as printed in (39).
    fn variance_as_printed<'py>(&self, py: Python<'py>, rig: &Rig) -> Numbers<'py> {
        let bf = rig.0.depth_disparity_product();
        each(py, &self.0, |flow| vz::dcce_variance_as_printed(flow, bf))
    }

    /// Coefficients (n, 2) of σ²_d and of σ²_v in the variance of (7), (53).
    fn coefficients<'py>(&self, py: Python<'py>, rig: &Rig) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let bf = rig.0.depth_disparity_product();
        coefficients(py, &self.0, |flow| vz::dcce_coefficients(flow, bf))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

/// Disparity before, disparity with its slopes after, and the displacement of points.
#[pyclass(module = "egomotion", frozen)]
pub struct DepthTracks(pub Vec<DepthTrack>);

#[pymethods]
impl DepthTracks {
    /// At (x, y) (n, 2) px: disparity (n, 4) = d, d′, d′x, d′y, and displacement (n, 2), in px.
    #[new]
    fn new(
        xy: &Bound<'_, PyAny>,
        disparity: &Bound<'_, PyAny>,
        displacement: &Bound<'_, PyAny>,
        disparity_cov: &Bound<'_, PyAny>,
        displacement_cov: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let disparity = gaussians::<4>("disparity", disparity, disparity_cov)?;
        let displacement = gaussians::<2>("displacement", displacement, displacement_cov)?;
        arrays::same_length("displacement", displacement.len(), disparity.len())?;
        let xy = places(xy, disparity.len())?;
        let all = xy.into_iter().zip(disparity).zip(displacement);
        let track = all.map(|((xy, disparity), displacement)| DepthTrack {
            x_px: xy.x,
            y_px: xy.y,
            disparity,
            displacement,
        });
        Ok(Self(track.collect()))
    }

    /// Change of depth at every point.
    fn depth_change(&self, py: Python<'_>, rig: &Rig) -> DepthChanges {
        let bf = rig.0.depth_disparity_product();
        DepthChanges(py.detach(|| self.0.par_iter().map(|track| track.depth_change(bf)).collect()))
    }

    /// VZ (n,), (17), and its variance (n,), (47c).
    fn depth_velocity<'py>(&self, py: Python<'py>, rig: &Rig) -> (Numbers<'py>, Numbers<'py>) {
        let bf = rig.0.depth_disparity_product();
        velocities(py, &self.0, |track| vz::dcce(&track.depth_change(bf)))
    }

    /// Variance (n,) of (17) as printed in (47).
    fn variance_as_printed<'py>(&self, py: Python<'py>, rig: &Rig) -> Numbers<'py> {
        let bf = rig.0.depth_disparity_product();
        each(py, &self.0, |track| vz::dcce_discrete_variance_as_printed(track, bf))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

/// Disparity, and flow of both cameras, at points.
#[pyclass(module = "egomotion", frozen)]
pub struct StereoFlows(pub Vec<StereoFlow>);

#[pymethods]
impl StereoFlows {
    /// At (x, y) (n, 2) px: measured (n, 4) = d, v_x left, v_y, v_x right, in px.
    #[new]
    fn new(
        xy: &Bound<'_, PyAny>,
        measured: &Bound<'_, PyAny>,
        measured_cov: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let measured = gaussians::<4>("measured", measured, measured_cov)?;
        let xy = places(xy, measured.len())?;
        let flow = xy.into_iter().zip(measured).map(|(xy, measured)| StereoFlow {
            x_px: xy.x,
            y_px: xy.y,
            measured,
        });
        Ok(Self(flow.collect()))
    }

    /// VZ (n,), (9), and its variance (n,), (44).
    fn depth_velocity<'py>(&self, py: Python<'py>, rig: &Rig) -> (Numbers<'py>, Numbers<'py>) {
        let bf = rig.0.depth_disparity_product();
        velocities(py, &self.0, |flow| vz::dv(flow, bf))
    }

    /// Coefficients (n, 2) of σ²_d and of σ²_v in the variance of (9), (53).
    fn coefficients<'py>(&self, py: Python<'py>, rig: &Rig) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let bf = rig.0.depth_disparity_product();
        coefficients(py, &self.0, |flow| vz::dv_coefficients(flow, bf))
    }

    /// Equations (13) of binocular flow, or with `as_printed` (14), weighted at the motion `at`.
    #[pyo3(signature = (rig, *, at = None, block_px = None, as_printed = false))]
    fn equations(
        &self,
        py: Python<'_>,
        rig: &Rig,
        at: Option<&Bound<'_, PyAny>>,
        block_px: Option<f64>,
        as_printed: bool,
    ) -> PyResult<Rows> {
        let at = at_motion(at)?;
        let constraint =
            if as_printed { binocular_flow::constraint_as_printed } else { binocular_flow::constraint };
        let place = |flow: &StereoFlow| (flow.x_px, flow.y_px);
        Ok(equations(py, &self.0, rig, block_px, place, |flow| vec![constraint(flow, &rig.0, &at)]))
    }

    /// Equations (3) of the left camera's flow, two for each point, weighted at the motion `at`.
    #[pyo3(signature = (rig, *, at = None, block_px = None))]
    fn flow_equations(
        &self,
        py: Python<'_>,
        rig: &Rig,
        at: Option<&Bound<'_, PyAny>>,
        block_px: Option<f64>,
    ) -> PyResult<Rows> {
        let at = at_motion(at)?;
        let place = |flow: &StereoFlow| (flow.x_px, flow.y_px);
        Ok(equations(py, &self.0, rig, block_px, place, |flow| {
            image_flow::constraints(flow, &rig.0, &at).to_vec()
        }))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

/// (x, y, d) of points before and after.
#[pyclass(module = "egomotion", frozen)]
pub struct StereoTracks(pub Vec<StereoTrack>);

#[pymethods]
impl StereoTracks {
    /// before and after (n, 3) = x, y, d in px, with variances (3,), (n, 3) or covariances (n, 3, 3).
    #[new]
    fn new(
        before: &Bound<'_, PyAny>,
        after: &Bound<'_, PyAny>,
        before_cov: &Bound<'_, PyAny>,
        after_cov: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let before = gaussians::<3>("before", before, before_cov)?;
        let after = gaussians::<3>("after", after, after_cov)?;
        arrays::same_length("after", after.len(), before.len())?;
        Ok(Self(before.into_iter().zip(after).map(|(before, after)| StereoTrack { before, after }).collect()))
    }

    /// (x, y, d) before, (n, 3).
    #[getter]
    fn before<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|track| track.before.mean))
    }

    /// (x, y, d) after, (n, 3).
    #[getter]
    fn after<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|track| track.after.mean))
    }

    /// Covariances before, (n, 3, 3).
    #[getter]
    fn before_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|track| track.before.cov))
    }

    /// Covariances after, (n, 3, 3).
    #[getter]
    fn after_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|track| track.after.cov))
    }

    /// VZ (n,) = Z′ − Z, (21), and its variance (n,), (50).
    fn depth_velocity<'py>(&self, py: Python<'py>, rig: &Rig) -> (Numbers<'py>, Numbers<'py>) {
        let bf = rig.0.depth_disparity_product();
        velocities(py, &self.0, |track| vz::dv_discrete(track, bf))
    }

    /// Variance (n,) of (21) as printed in (49).
    fn variance_as_printed<'py>(&self, py: Python<'py>, rig: &Rig) -> Numbers<'py> {
        let bf = rig.0.depth_disparity_product();
        each(py, &self.0, |track| vz::dv_discrete_variance_as_printed(track, bf))
    }

    /// The finite displacements as flow, (19) and (20): with it (9) gives (21).
    fn discrete_flow(&self, py: Python<'_>) -> StereoFlows {
        StereoFlows(py.detach(|| self.0.par_iter().map(StereoTrack::discrete_flow).collect()))
    }

    /// Velocities at the middle of the interval, by central differences.
    fn midpoint_flow(&self, py: Python<'_>) -> StereoFlows {
        StereoFlows(py.detach(|| self.0.par_iter().map(StereoTrack::midpoint_flow).collect()))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

/// The exact change of depth (n,) by (6): Z (n,) in metres at t, the disparity map (H, W) after, places (u, v) (n, 2) in
/// px where the points have moved to; NaN where the map has no value. Disparity is interpolated, not Z.
#[pyfunction]
pub fn exact_change<'py>(
    py: Python<'py>,
    z: &Bound<'py, PyAny>,
    after: &Bound<'py, PyAny>,
    uv: &Bound<'py, PyAny>,
    rig: &Rig,
) -> PyResult<Numbers<'py>> {
    let (z, after, uv) =
        (arrays::vector("z", z)?, arrays::field("after", after)?, arrays::rows::<2>("uv", uv)?);
    arrays::same_length("uv", uv.len(), z.len())?;
    let change =
        z.iter().zip(&uv).map(|(&z, uv)| vz::exact_change(z, &after, uv.x, uv.y, &rig.0).unwrap_or(f64::NAN));
    Ok(PyArray1::from_iter(py, change))
}

/// The smallest change of depth (n,) in metres that a disparity step shows at disparities d (n,), (51).
#[pyfunction]
pub fn smallest_change<'py>(
    py: Python<'py>,
    d: &Bound<'py, PyAny>,
    step: f64,
    rig: &Rig,
) -> PyResult<Numbers<'py>> {
    let bf = rig.0.depth_disparity_product();
    Ok(PyArray1::from_iter(py, arrays::vector("d", d)?.into_iter().map(|d| vz::smallest_change(d, step, bf))))
}
