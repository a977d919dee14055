//! What a page is made of: plain values of a run.

use egomotion::estimate::MotionEstimate;
use egomotion::geometry::{RigidMotion, StereoRig, Twist};
use egomotion::motion::{NoObstacle, Obstacle};
use egomotion::pipeline::MovingGroup;
use nalgebra::Matrix6;

use super::album::Album;
use super::interval::Interval;

/// Status of a frame that has no earlier one to compare with; it does not count as unanswered.
const FIRST_STATUS: &str = "first";

/// Everything a page shows.
#[derive(Debug, Clone)]
pub struct Report<'a> {
    /// Headline.
    pub title: String,
    /// What was read.
    pub source: String,
    /// The command that repeats the run.
    pub command: String,
    /// Every setting, as TOML.
    pub settings_toml: String,
    /// The rig.
    pub rig: &'a StereoRig,
    /// What the recording was made with.
    pub input: InputKind,
    /// Whether corners alone were followed, so that there are no maps.
    pub sparse: bool,
    /// Whether every frame was done.
    pub complete: bool,
    /// One row a frame, in order.
    pub frames: &'a [FrameRow],
    /// world_from_camera, one a row.
    pub poses: &'a [RigidMotion],
    /// Covariance of δ in T = T̂ exp(δ) of each pose, (translation, rotation) in metres and radians, 6×6; infinite where
    /// nothing is known of it.
    pub pose_covariances: &'a [Matrix6<f64>],
    /// True poses, one a row; brought to the first estimated pose before they are drawn.
    pub truth: Option<&'a [RigidMotion]>,
    /// Pictures of some frames, in order.
    pub album: &'a Album,
    /// Mean milliseconds a frame of each stage, in order.
    pub stages_ms: Vec<(&'static str, f64)>,
    /// Mean milliseconds a frame of everything.
    pub frame_ms: f64,
    /// Whether the method does not hold on this recording, so that its numbers are wrong; a note says why.
    pub biased: bool,
    /// What the reader should know besides, one sentence each.
    pub notes: Vec<String>,
}

/// What a recording was made with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputKind {
    /// Two cameras.
    Stereo,
    /// One camera, and the depth of its pixels.
    Depth,
    /// Tracks that another program found in the images of two cameras.
    Tracks,
}

/// What one frame says.
#[derive(Debug, Clone)]
pub struct FrameRow {
    /// Index in the source.
    pub frame: usize,
    /// Time, in seconds.
    pub time_s: f64,
    /// Interval of φ, in seconds.
    pub dt_s: Option<f64>,
    /// φ over that interval, scene motion of the left camera; `None` where there is no answer.
    pub motion: Option<MotionEstimate>,
    /// True φ over the same interval.
    pub truth: Option<Twist>,
    /// The nearest obstacle, or why there is none.
    pub obstacle: Result<Obstacle, NoObstacle>,
    /// What moves by itself.
    pub moving: Vec<MovingGroup>,
    /// `ok`, `partial`, `first`, or why there is no answer.
    pub status: String,
}

impl Report<'_> {
    /// Time of each row and the axis' name: seconds since the first row, or the frame's number where times do
    /// not increase.
    pub(crate) fn times(&self) -> (Vec<f64>, &'static str) {
        let times = self.frames.iter().map(|row| row.time_s);
        let increasing = times.clone().zip(times.clone().skip(1)).all(|(a, b)| b > a);
        match self.frames.first() {
            Some(first) if increasing && self.frames.iter().all(|row| row.time_s.is_finite()) => {
                (times.map(|t| t - first.time_s).collect(), "time (s)")
            }
            _ => ((0..self.frames.len()).map(|k| k as f64).collect(), "frame of the run"),
        }
    }
}

impl FrameRow {
    /// Whether there is an earlier frame to compare with, so that an answer is asked for.
    pub(crate) fn asks(&self) -> bool {
        self.status != FIRST_STATUS
    }

    /// Component `i` of φ ± σ in metres and radians, if it is observed and finite.
    pub(crate) fn component(&self, i: usize) -> Option<(f64, f64)> {
        let motion = self.motion.as_ref().filter(|m| m.observed[i])?;
        let (value, sigma) = (motion.theta.mean[i], motion.theta.sigma(i));
        (value.is_finite() && sigma.is_finite()).then_some((value, sigma))
    }

    /// The interval of φ, if it is one.
    pub(crate) fn interval_s(&self) -> Option<f64> {
        self.dt_s.filter(|dt| dt.is_finite() && *dt > 0.0)
    }

    /// Time to impact of the nearest obstacle.
    pub(crate) fn impact(&self) -> Option<Interval> {
        Interval::of_impact(&self.obstacle.ok()?.impact)
    }
}
