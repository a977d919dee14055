//! Depth or disparity with its derivatives, and the left camera's flow: what the depth change constraint takes.

use egomotion::constrain::dcce;
use egomotion::motion::depth_velocity as vz;
use egomotion::observe::{DepthChange, DepthFlow, DepthTrack};
use nalgebra::SVector;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use rayon::prelude::*;

use super::{Numbers, at_motion, coefficients, each, equations, points, velocities};
use crate::arrays;
use crate::rig::Rig;
use crate::rows::Rows;

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
        let (depth, flow) = (("depth", depth, depth_cov), ("flow", flow, flow_cov));
        points(xy, depth, flow, |x_px, y_px, depth, flow| DepthChange { x_px, y_px, depth, flow }).map(Self)
    }

    /// Places (x, y), (n, 2) px.
    #[getter]
    fn xy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| SVector::from([point.x_px, point.y_px])))
    }

    /// Z, Zx, Zy, Zt (n, 4).
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| point.depth.mean))
    }

    /// Their covariances (n, 4, 4).
    #[getter]
    fn depth_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|point| point.depth.cov))
    }

    /// Flow (n, 2) in px.
    #[getter]
    fn flow<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| point.flow.mean))
    }

    /// Its covariances (n, 2, 2).
    #[getter]
    fn flow_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|point| point.flow.cov))
    }

    /// VZ (n,) in metres per interval and its variance (n,): (7) with (39c), or (17) with (47c).
    fn depth_velocity<'py>(&self, py: Python<'py>) -> (Numbers<'py>, Numbers<'py>) {
        velocities(py, &self.0, vz::dcce)
    }

    /// Variance (n,) of VZ with the product of the two noises.
    fn variance_with_product<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        each(py, &self.0, vz::dcce_variance_with_product)
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
        let (disparity, flow) = (("disparity", disparity, disparity_cov), ("flow", flow, flow_cov));
        let point = |x_px, y_px, disparity, flow| DepthFlow { x_px, y_px, disparity, flow };
        points(xy, disparity, flow, point).map(Self)
    }

    /// Places (x, y), (n, 2) px.
    #[getter]
    fn xy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| SVector::from([point.x_px, point.y_px])))
    }

    /// d, dx, dy, dt (n, 4) in px.
    #[getter]
    fn disparity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| point.disparity.mean))
    }

    /// Their covariances (n, 4, 4).
    #[getter]
    fn disparity_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|point| point.disparity.cov))
    }

    /// Flow (n, 2) in px.
    #[getter]
    fn flow<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| point.flow.mean))
    }

    /// Its covariances (n, 2, 2).
    #[getter]
    fn flow_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|point| point.flow.cov))
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
        let disparity = ("disparity", disparity, disparity_cov);
        let displacement = ("displacement", displacement, displacement_cov);
        let point = |x_px, y_px, disparity, displacement| DepthTrack { x_px, y_px, disparity, displacement };
        points(xy, disparity, displacement, point).map(Self)
    }

    /// Places (x, y), (n, 2) px.
    #[getter]
    fn xy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| SVector::from([point.x_px, point.y_px])))
    }

    /// d, d′, d′x, d′y (n, 4) in px.
    #[getter]
    fn disparity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| point.disparity.mean))
    }

    /// Their covariances (n, 4, 4).
    #[getter]
    fn disparity_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|point| point.disparity.cov))
    }

    /// Displacement (n, 2) in px.
    #[getter]
    fn displacement<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| point.displacement.mean))
    }

    /// Its covariances (n, 2, 2).
    #[getter]
    fn displacement_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|point| point.displacement.cov))
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

    /// Coefficients (n, 2) of σ²_d and of σ²_v in the variance of (17) as printed in (47), (53); d_t has 2 σ²_d.
    fn coefficients<'py>(&self, py: Python<'py>, rig: &Rig) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let bf = rig.0.depth_disparity_product();
        coefficients(py, &self.0, |track| vz::dcce_discrete_coefficients(track, bf))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}
