//! A depth camera through the same pipeline: depth becomes the disparity of a virtual stereo rig.
//!
//! With d = b f/Z a depth image is a disparity map whose right camera nobody needs: tracks, flow, every method,
//! depth velocity and time to impact are those of [`StereoMotion`]. The baseline b is a choice that cancels in every
//! answer; [`VIRTUAL_BASELINE_M`] gives disparities the size that a stereo head of that kind would measure, in
//! which the pipeline's tolerances are stated.

use serde::{Deserialize, Serialize};

use super::answer::{FrameMotion, Unanswered};
use super::config::{Config, PipelineError};
use super::frame::Frame;
use super::stereo_motion::StereoMotion;
use crate::estimate::Tolerance;
use crate::geometry::{Field, Grid, Image, StereoRig};
use crate::observe::DisparityMap;

/// Baseline of the virtual rig of a depth camera, in metres: that of the structured-light sensors of PrimeSense.
pub const VIRTUAL_BASELINE_M: f64 = 0.075;

/// Standard deviation of what a depth sensor measures, by kind of sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum DepthNoise {
    /// Triangulation against a projected pattern: σ_Z = `per_m` Z², and depth in steps of `step_per_m` Z².
    ///
    /// Kinect v1 and its kin; the step is that of 1/8 px of its own disparity.
    StructuredLight {
        /// σ_Z/Z², in 1/m.
        per_m: f64,
        /// Step of depth over Z², in 1/m; it adds step²/12 to the variance (52).
        step_per_m: f64,
    },
    /// Time of flight: σ_Z = `constant_m` + `per_m` Z.
    TimeOfFlight {
        /// At distance 0, in metres.
        constant_m: f64,
        /// Growth per metre of distance.
        per_m: f64,
    },
    /// Stereo matching by the sensor itself: σ_Z = Z² σ_d/(b f).
    Stereo {
        /// b f of the sensor, in metre pixels.
        depth_disparity_product: f64,
        /// Standard deviation of its disparity, in pixels.
        sigma_px: f64,
    },
    /// Rendered or otherwise exact: σ_Z = `relative` Z, for rounding alone.
    Exact {
        /// σ_Z/Z.
        relative: f64,
    },
}

impl DepthNoise {
    /// Kinect v1 (Khoshelham and Elberink 2012: 1.425·10⁻³ Z² for σ of half a disparity unit, steps of 2.85·10⁻³ Z²).
    pub fn kinect() -> Self {
        Self::StructuredLight { per_m: 1.425e-3, step_per_m: 2.85e-3 }
    }

    /// Of time-of-flight cameras for rooms: 2 mm, and 1 mm more for each metre, in good light.
    pub fn time_of_flight() -> Self {
        Self::TimeOfFlight { constant_m: 2e-3, per_m: 1e-3 }
    }

    /// Of rendered depth.
    pub fn exact() -> Self {
        Self::Exact { relative: 1e-4 }
    }

    /// How well a sensor of the kind is known, apart from its noise.
    ///
    /// Of a sensor that one holds in the hand: calibrations of focal lengths repeat to some thousandths and those of
    /// principal points to a pixel, depth of Kinects differs by up to a percent from one to the next; colour cameras
    /// have rolling shutters and take most of a frame to read, and are not triggered with depth.
    pub fn tolerance(&self) -> Tolerance {
        let hand_held =
            Tolerance { focal: 2e-3, centre_px: 1.0, scale: 5e-3, readout_s: 0.03, delay_s: 5e-3 };
        match self {
            Self::StructuredLight { .. } | Self::Stereo { .. } => hand_held,
            Self::TimeOfFlight { .. } => Tolerance { scale: 2e-3, delay_s: 2e-3, ..hand_held },
            Self::Exact { .. } => Tolerance::rendered(),
        }
    }

    /// The choices of a run, with the tolerance of this kind unless they have one.
    pub fn tolerated(&self, config: Config) -> Config {
        let own = config.tolerance;
        Config { tolerance: if own.is_exact() { self.tolerance() } else { own }, ..config }
    }

    /// σ_Z of a depth, both in metres.
    pub fn sigma_m(&self, z_m: f64) -> f64 {
        match *self {
            Self::StructuredLight { per_m, step_per_m } => z_m * z_m * per_m.hypot(step_per_m / 12f64.sqrt()),
            Self::TimeOfFlight { constant_m, per_m } => constant_m + per_m * z_m,
            Self::Stereo { depth_disparity_product, sigma_px } => {
                z_m * z_m * sigma_px / depth_disparity_product
            }
            Self::Exact { relative } => relative * z_m,
        }
    }
}

/// A depth camera whose depth images lie on the pixel grid of its intensity images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthCamera {
    /// The virtual rig: the camera's own intrinsics, and a baseline that is a choice ([`VIRTUAL_BASELINE_M`]).
    pub rig: StereoRig,
    /// How noisy its depth is.
    pub noise: DepthNoise,
}

impl DepthCamera {
    /// Disparity of the virtual rig from depth along the optical axis, in metres; depths that are not positive are
    /// missing.
    pub fn disparity(&self, depth_m: &Field) -> DisparityMap {
        let bf = self.rig.depth_disparity_product();
        let shift = |z: f32| {
            let d = self.rig.disparity(f64::from(z)).map(|d| self.rig.shift_from_disparity(d));
            d.map_or(f32::NAN, |d| d as f32)
        };
        let (width, height) = depth_m.size();
        let shifts = Grid::from_fn(width, height, |u, v| depth_m.get(u, v).map_or(f32::NAN, shift));
        DisparityMap::given(Field::from_grid(shifts), |shift| {
            let d = self.rig.disparity_from_shift(f64::from(shift));
            let z = bf / d;
            (self.noise.sigma_m(z) * d / z) as f32
        })
    }

    /// The image and depth (in metres, on the same pixels) of one time, for the pipeline of the virtual rig.
    pub fn frame(&self, time_s: f64, left: Image, depth_m: &Field) -> Frame {
        Frame { time_s, left, right: None, disparity: Some(self.disparity(depth_m)), flow: None }
    }
}

/// Turns a sequence of depth images with intensity into motion: [`StereoMotion`] of the virtual rig.
#[derive(Debug)]
pub struct RgbdMotion {
    camera: DepthCamera,
    motion: StereoMotion,
}

impl RgbdMotion {
    /// A pipeline for one camera.
    ///
    /// # Errors
    /// [`PipelineError`] when the camera cannot measure or the choices do not fit together.
    pub fn new(camera: DepthCamera, config: Config) -> Result<Self, PipelineError> {
        Ok(Self { motion: StereoMotion::new(camera.rig, camera.noise.tolerated(config))?, camera })
    }

    /// The motion from the last good frame to this one; depth in metres, on the image's pixels.
    pub fn push(&mut self, time_s: f64, image: Image, depth_m: &Field) -> FrameMotion {
        self.motion.push(self.camera.frame(time_s, image, depth_m))
    }

    /// Account for a frame that could not be read.
    pub fn skip(&mut self, time_s: f64, why: Unanswered) -> FrameMotion {
        self.motion.skip(time_s, why)
    }

    /// The frame that the next one will be matched with.
    pub fn reference(&self) -> Option<usize> {
        self.motion.reference()
    }
}
