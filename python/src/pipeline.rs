//! Frames in, motion out.

use egomotion::pipeline::VIRTUAL_BASELINE_M;
use egomotion::pipeline::{DepthCamera, DepthNoise, Frame, RgbdMotion as Rgbd, StereoMotion as Stereo};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::config::{Threads, config};
use crate::doubt::Doubt;
use crate::error;
use crate::frame_motion::FrameMotion;
use crate::front_end::{precomputed_disparity, precomputed_flow};
use crate::rig::Rig;

/// Turns a sequence of rectified stereo images into motion.
#[pyclass(module = "egomotion")]
pub struct StereoMotion {
    motion: Stereo,
    threads: Threads,
    doubt: Doubt,
}

#[pymethods]
impl StereoMotion {
    /// A pipeline for one rig, on so many threads of its own or on those of the process.
    ///
    /// `mask` (H, W) bool marks pixels never to use; other keywords are the settings of `default_config()`.
    #[new]
    #[pyo3(signature = (rig, *, threads = None, mask = None, **settings))]
    fn new(
        py: Python<'_>,
        rig: &Rig,
        threads: Option<usize>,
        mask: Option<&Bound<'_, PyAny>>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut motion = Stereo::new(rig.0, config(py, settings)?).map_err(error::value)?;
        if let Some(mask) = mask {
            let mask = arrays::mask("mask", mask)?;
            let wanted = (rig.0.width_px, rig.0.height_px);
            if mask.size() != wanted {
                let words = format!("mask is {:?} pixels wide and high, the rig {wanted:?}", mask.size());
                return Err(PyValueError::new_err(words));
            }
            motion.set_mask(Some(mask));
        }
        Ok(Self { motion, threads: Threads::new(threads)?, doubt: Doubt::default() })
    }

    /// The motion from the last good frame to this one, at `time_s` in seconds.
    ///
    /// Images are (H, W), or (H, W, 3) as red, green, blue; uint8, uint16 (0 … 65535) or float32
    /// (0 … 255). With `disparity` (H, W), and perhaps
    /// its `disparity_sigma`, of the left image's pixels that map is used in place of our own, and the right image may
    /// be None. With `flow` (H, W, 2), and perhaps its `flow_cov` (H, W, 3) as uu, uv, vv, from the left image of the
    /// frame before to this one, on the earlier one's pixels, that is used too. An image that cannot be used is no exception: the answer's status says why.
    #[pyo3(signature = (
        left, right, time_s, *, disparity = None, disparity_sigma = None, flow = None, flow_cov = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn push(
        &mut self,
        py: Python<'_>,
        left: &Bound<'_, PyAny>,
        right: Option<&Bound<'_, PyAny>>,
        time_s: f64,
        disparity: Option<&Bound<'_, PyAny>>,
        disparity_sigma: Option<&Bound<'_, PyAny>>,
        flow: Option<&Bound<'_, PyAny>>,
        flow_cov: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<FrameMotion> {
        let left = arrays::image("left", left)?;
        let right = right.map(|right| arrays::image("right", right)).transpose()?;
        let disparity = precomputed_disparity(disparity, disparity_sigma)?;
        if let Some(flow) = precomputed_flow(flow, flow_cov)? {
            self.motion.set_flow(flow).map_err(error::value)?;
        }
        if right.is_none() && disparity.is_none() {
            return Err(PyValueError::new_err("give the right image, or a disparity map"));
        }
        let frame = Frame { time_s, left, right, disparity, flow: None };
        let motion = &mut self.motion;
        let answer = self.threads.run(py, || motion.push(frame));
        self.doubt.of(py, &answer)?;
        Ok(FrameMotion::of(answer))
    }
}

/// Turns a sequence of depth images with intensity into motion.
#[pyclass(module = "egomotion")]
pub struct RgbdMotion {
    motion: Rgbd,
    threads: Threads,
    doubt: Doubt,
}

#[pymethods]
impl RgbdMotion {
    /// A pipeline for a depth camera of focal length (px), principal point (px) and image size (width, height).
    ///
    /// `noise` is "kinect" (structured light), "time-of-flight" or "exact"; other keywords are the settings of
    /// `default_config()`.
    #[new]
    #[pyo3(signature = (focal_px, centre_px, size_px, *, focal_y_px = None, noise = "kinect", threads = None, **settings))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        focal_px: f64,
        centre_px: (f64, f64),
        size_px: (usize, usize),
        focal_y_px: Option<f64>,
        noise: &str,
        threads: Option<usize>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut rig = egomotion::geometry::StereoRig::new(focal_px, centre_px, VIRTUAL_BASELINE_M, size_px)
            .map_err(error::value)?;
        rig.focal_y_px = focal_y_px.unwrap_or(focal_px);
        let noise = match noise {
            "kinect" => DepthNoise::kinect(),
            "time-of-flight" => DepthNoise::time_of_flight(),
            "exact" => DepthNoise::exact(),
            other => {
                let words =
                    format!("noise {other:?} is not known; give 'kinect', 'time-of-flight' or 'exact'");
                return Err(PyValueError::new_err(words));
            }
        };
        let motion = Rgbd::new(DepthCamera { rig, noise }, config(py, settings)?).map_err(error::value)?;
        Ok(Self { motion, threads: Threads::new(threads)?, doubt: Doubt::default() })
    }

    /// The motion from the last good frame to this one; `depth` (H, W) in metres on the image's pixels, NaN or 0 where
    /// it is unknown.
    fn push(
        &mut self,
        py: Python<'_>,
        image: &Bound<'_, PyAny>,
        depth: &Bound<'_, PyAny>,
        time_s: f64,
    ) -> PyResult<FrameMotion> {
        let (image, depth) = (arrays::image("image", image)?, arrays::field("depth", depth)?);
        let motion = &mut self.motion;
        let answer = self.threads.run(py, || motion.push(time_s, image, &depth));
        self.doubt.of(py, &answer)?;
        Ok(FrameMotion::of(answer))
    }
}
