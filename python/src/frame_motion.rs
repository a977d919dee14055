//! What one frame says about motion since the one before.

use std::sync::Arc;

use egomotion::geometry::{Field, Grid, PixelBounds, RigidMotion};
use egomotion::motion::{Obstacle, TimeToImpact};
use egomotion::pipeline::DenseResults;
use egomotion::pipeline::{self, MovingGroup as Group};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::estimators::Estimate;
use crate::geometry::{Motion, pose};

/// A rectangle of pixels: u, v, width, height.
type Rectangle = (usize, usize, usize, usize);
/// A map (H, W).
type Map<'py> = Bound<'py, PyArray2<f32>>;

fn rectangle(bounds: &PixelBounds) -> Rectangle {
    (bounds.u, bounds.v, bounds.width, bounds.height)
}

/// Time to impact, counted from the later frame.
#[pyclass(module = "egomotion", frozen)]
pub struct Impact {
    impact: TimeToImpact,
    obstacle: Option<Obstacle>,
}

#[pymethods]
impl Impact {
    /// Seconds until impact; None where it does not approach.
    #[getter]
    fn seconds(&self) -> Option<f64> {
        self.impact.seconds()
    }

    /// 95 % interval in seconds; its far end may be infinite. None where the whole of it recedes.
    #[getter]
    fn interval95_s(&self) -> Option<(f64, f64)> {
        self.impact.interval95_s()
    }

    /// Inverse of the time to impact, in 1/s.
    #[getter]
    fn looming(&self) -> f64 {
        self.impact.looming.value()
    }

    /// Standard deviation of looming.
    #[getter]
    fn looming_sigma(&self) -> f64 {
        self.impact.looming.sigma(0)
    }

    /// Rectangle (u, v, width, height) in the earlier left image, of an obstacle.
    #[getter]
    fn bounds(&self) -> Option<Rectangle> {
        self.obstacle.as_ref().map(|obstacle| rectangle(&obstacle.bounds))
    }

    /// Points that will cross what the vehicle sweeps, of an obstacle.
    #[getter]
    fn points(&self) -> Option<usize> {
        self.obstacle.as_ref().map(|obstacle| obstacle.points)
    }

    fn __repr__(&self) -> String {
        match (self.impact.seconds(), self.impact.interval95_s()) {
            (Some(seconds), Some((low, high))) => {
                format!("Impact({seconds:.3} s, 95 %: {low:.3} to {high:.3} s)")
            }
            _ => "Impact(recedes)".into(),
        }
    }
}

/// Something that moves by itself.
#[pyclass(module = "egomotion", frozen)]
pub struct MovingGroup(Group);

#[pymethods]
impl MovingGroup {
    /// Pixels of the earlier left image that it covers.
    #[getter]
    fn pixels(&self) -> usize {
        self.0.pixels
    }

    /// The least rectangle (u, v, width, height) around them.
    #[getter]
    fn bounds(&self) -> Rectangle {
        rectangle(&self.0.bounds)
    }

    /// Median depth at the earlier frame, in metres.
    #[getter]
    fn depth_m(&self) -> f64 {
        self.0.depth_m
    }

    /// Its motion relative to the left camera; None where its pixels determine none.
    #[getter]
    fn motion(&self) -> Option<Estimate> {
        self.0.motion.as_ref().map(Estimate::of)
    }

    /// VZ at its centre in metres per interval, and its σ.
    #[getter]
    fn depth_velocity(&self) -> (f64, f64) {
        (self.0.depth_velocity.value(), self.0.depth_velocity.sigma(0))
    }

    /// Time to impact of its centre; None where it gets behind the camera.
    #[getter]
    fn impact(&self) -> Option<Impact> {
        self.0.impact.map(|impact| Impact { impact, obstacle: None })
    }
}

/// What one frame says about motion since its reference frame.
///
/// Maps lie on the earlier left image's pixels, float32 (H, W) with NaN where there is no answer; they are None
/// unless the pipeline observes densely, and each access makes a new array.
#[pyclass(module = "egomotion", frozen)]
pub struct FrameMotion {
    answer: Arc<pipeline::FrameMotion>,
    /// Number of the frame in its recording.
    index: usize,
    /// world_from_camera, where a trajectory is kept.
    pose: Option<RigidMotion>,
    truth: Option<RigidMotion>,
}

impl FrameMotion {
    pub fn of(answer: pipeline::FrameMotion) -> Self {
        Self { index: answer.frame, answer: Arc::new(answer), pose: None, truth: None }
    }

    /// The same as a frame of a recording.
    pub fn placed(self, index: usize, pose: Option<RigidMotion>, truth: Option<RigidMotion>) -> Self {
        Self { index, pose, truth, ..self }
    }

    fn estimate(&self) -> Option<&egomotion::estimate::MotionEstimate> {
        self.answer.motion.as_ref().ok()
    }

    fn map<'py>(&self, py: Python<'py>, map: impl Fn(&DenseResults) -> &Field) -> PyResult<Option<Map<'py>>> {
        self.answer.dense.as_ref().map(|dense| arrays::field_plane(py, map(dense))).transpose()
    }

    fn seconds<'py>(
        &self,
        py: Python<'py>,
        quantity: impl Fn(&TimeToImpact) -> Option<f64> + Sync,
    ) -> PyResult<Option<Map<'py>>> {
        let grid: Option<Grid<f32>> = self.answer.dense.as_ref().map(|dense| dense.motion.seconds(&quantity));
        grid.map(|grid| arrays::plane(py, &grid)).transpose()
    }
}

#[pymethods]
impl FrameMotion {
    /// Number of the frame in its recording, or of those pushed.
    #[getter]
    fn frame(&self) -> usize {
        self.index
    }

    /// Time in seconds.
    #[getter]
    fn time_s(&self) -> f64 {
        self.answer.time_s
    }

    /// Seconds since the earlier frame that it was matched with; None without one.
    #[getter]
    fn dt_s(&self) -> Option<f64> {
        self.answer.dt_s
    }

    /// "ok", "partial" where not all components are determined, or one word for why there is no answer.
    #[getter]
    fn status(&self) -> &'static str {
        match &self.answer.motion {
            Ok(estimate) if estimate.is_complete() => "ok",
            Ok(_) => "partial",
            Err(why) => why.code(),
        }
    }

    /// Why there is no answer, in words; None where there is one.
    #[getter]
    fn reason(&self) -> Option<String> {
        self.answer.motion.as_ref().err().map(ToString::to_string)
    }

    /// The estimate of φ; None without an answer.
    #[getter]
    fn motion(&self) -> Option<Estimate> {
        self.estimate().map(Estimate::of)
    }

    /// φ (6,) = (tX, tY, tZ, ΩX, ΩY, ΩZ): motion of the scene relative to the left camera over `dt_s`, metres and
    /// radians; NaN where it is not determined.
    #[getter]
    fn phi<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let component = |i: usize| self.estimate().map_or(f64::NAN, |found| found.theta.mean[i]);
        PyArray1::from_iter(py, (0..6).map(component))
    }

    /// Covariance (6, 6) of φ; infinite variance where it is not determined, NaN without an answer.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let unknown = nalgebra::Matrix6::from_element(f64::NAN);
        arrays::square(py, self.estimate().map_or(&unknown, |found| &found.theta.cov))
    }

    /// world_from_camera: rotation (3, 3) and translation (3,), the first frame's the identity; of a recording.
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Option<Motion<'py>>> {
        self.pose.as_ref().map(|motion| pose(py, motion)).transpose()
    }

    /// The true pose world_from_camera of a recording that has it, in the truth's own world.
    #[getter]
    fn true_pose<'py>(&self, py: Python<'py>) -> PyResult<Option<Motion<'py>>> {
        self.truth.as_ref().map(|motion| pose(py, motion)).transpose()
    }

    /// Time to impact of the nearest obstacle in what the vehicle sweeps (the settings `vehicle`); None without one.
    #[getter]
    fn impact(&self) -> Option<Impact> {
        self.answer
            .obstacle
            .as_ref()
            .ok()
            .map(|found| Impact { impact: found.impact, obstacle: Some(*found) })
    }

    /// One word for why there is no obstacle; None with one.
    #[getter]
    fn no_obstacle_reason(&self) -> Option<&'static str> {
        self.answer.obstacle.as_ref().err().map(|why| why.code())
    }

    /// What moves by itself, the largest first.
    #[getter]
    fn moving_groups(&self) -> Vec<MovingGroup> {
        self.answer.moving.iter().cloned().map(MovingGroup).collect()
    }

    /// By how much matches of left and right lie on different rows, in pixels.
    #[getter]
    fn row_disagreement_px(&self) -> Option<f64> {
        self.answer.row_disagreement_px
    }

    /// Why the method does not hold on these frames, where tracked corners contradict its answer; None where they do not.
    #[getter]
    fn contradiction(&self) -> Option<String> {
        self.answer.contradiction.map(|found| found.to_string())
    }

    /// u_left − u_right in pixels.
    #[getter]
    fn disparity<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.map(py, |dense| &dense.disparity.shift)
    }

    /// σ of disparity in pixels.
    #[getter]
    fn disparity_sigma<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.map(py, |dense| &dense.disparity.sigma)
    }

    /// Flow of the left image (H, W, 2) in pixels.
    #[getter]
    fn flow<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        self.answer
            .dense
            .as_ref()
            .map(|dense| arrays::planes(py, &[dense.flow.u.grid(), dense.flow.v.grid()]))
            .transpose()
    }

    /// Its covariance (H, W, 3) as uu, uv, vv in px².
    #[getter]
    fn flow_cov<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        let dense = self.answer.dense.as_ref();
        dense
            .map(|dense| arrays::planes(py, &[&dense.flow.cov_uu, &dense.flow.cov_uv, &dense.flow.cov_vv]))
            .transpose()
    }

    /// VZ in metres per interval; negative approaches.
    #[getter]
    fn depth_velocity<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.map(py, |dense| &dense.motion.depth_velocity)
    }

    /// σ of VZ.
    #[getter]
    fn depth_velocity_sigma<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.map(py, |dense| &dense.motion.depth_velocity_sigma)
    }

    /// Looming in 1/s: the inverse of the time to impact, positive where a point approaches.
    #[getter]
    fn looming<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.map(py, |dense| &dense.motion.looming)
    }

    /// σ of looming.
    #[getter]
    fn looming_sigma<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.map(py, |dense| &dense.motion.looming_sigma)
    }

    /// Seconds to impact of every pixel that approaches, from the later frame.
    #[getter]
    fn impact_map<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.seconds(py, TimeToImpact::seconds)
    }

    /// Near end of its 95 % interval.
    #[getter]
    fn impact_low<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.seconds(py, |impact| Some(impact.interval95_s()?.0))
    }

    /// Far end of its 95 % interval; it may be infinite.
    #[getter]
    fn impact_high<'py>(&self, py: Python<'py>) -> PyResult<Option<Map<'py>>> {
        self.seconds(py, |impact| Some(impact.interval95_s()?.1))
    }

    /// Milliseconds by stage.
    #[getter]
    fn stages_ms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (stages, dict) = (&self.answer.stages, PyDict::new(py));
        for (name, ms) in [
            ("pyramids", stages.pyramids_ms),
            ("disparity", stages.disparity_ms),
            ("tracks", stages.tracks_ms),
            ("flow", stages.flow_ms),
            ("estimate", stages.estimate_ms),
            ("maps", stages.maps_ms),
        ] {
            dict.set_item(name, ms)?;
        }
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        let phi = self.estimate().map_or(String::new(), |found| {
            let parts = (0..6).map(|i| format!("{:.5}", found.theta.mean[i]));
            format!(", phi=[{}]", parts.collect::<Vec<_>>().join(", "))
        });
        format!(
            "FrameMotion(frame={}, time_s={:.3}, status={:?}{phi})",
            self.index,
            self.answer.time_s,
            self.status()
        )
    }
}
