//! Disparity and flow of both cameras: what binocular flow and maximum likelihood take.

use egomotion::constrain::{binocular_flow, image_flow};
use egomotion::motion::depth_velocity as vz;
use egomotion::observe::{StereoFlow, StereoTrack};
use nalgebra::SVector;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use rayon::prelude::*;

use super::{Numbers, at_motion, coefficients, each, equations, gaussians, velocities};
use crate::arrays;
use crate::rig::Rig;
use crate::rows::Rows;

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
        let xy = arrays::rows::<2>("xy", xy)?;
        arrays::same_length("xy", xy.len(), measured.len())?;
        let flow = xy.into_iter().zip(measured).map(|(xy, measured)| StereoFlow {
            x_px: xy.x,
            y_px: xy.y,
            measured,
        });
        Ok(Self(flow.collect()))
    }

    /// Places (x, y), (n, 2) px.
    #[getter]
    fn xy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| SVector::from([point.x_px, point.y_px])))
    }

    /// d, v_x left, v_y, v_x right (n, 4) in px.
    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::table(py, self.0.iter().map(|point| point.measured.mean))
    }

    /// Their covariances (n, 4, 4).
    #[getter]
    fn measured_cov<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::stack(py, self.0.iter().map(|point| point.measured.cov))
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

    /// Coefficients (n, 2) of σ²_d and of σ²_v in the variance of (21), (53); the second is 0.
    fn coefficients<'py>(&self, py: Python<'py>, rig: &Rig) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let bf = rig.0.depth_disparity_product();
        coefficients(py, &self.0, |track| vz::dv_discrete_coefficients(track, bf))
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
