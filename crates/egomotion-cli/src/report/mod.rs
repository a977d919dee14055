//! `report.html`: a run as one self-contained page, made to be looked at.
//!
//! [`render`] turns plain values into the page; it reads and writes nothing. Pictures are made while the run
//! goes on ([`Album`]), so that no maps are kept.

mod charts;
mod figures;
mod impact;
mod page;
mod pictures;
mod tables;
#[cfg(test)]
mod tests;
mod trajectory;

use egomotion::estimate::MotionEstimate;
use egomotion::geometry::{RigidMotion, StereoRig, Twist};
use egomotion::motion::{NoObstacle, TimeToImpact};

pub use page::render;
pub use pictures::{Album, FramePictures, MOST_PICTURES};

/// Status of a frame that has no earlier one to compare with; it does not count as unanswered.
const FIRST: &str = "first";

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
    /// One row a frame, in order; the first frame may be left out.
    pub frames: &'a [FrameRow],
    /// world_from_camera, one a frame.
    pub poses: &'a [RigidMotion],
    /// True poses, one a frame; brought to the first estimated pose before they are drawn.
    pub truth: Option<&'a [RigidMotion]>,
    /// Pictures of some frames, in order; none of a sparse run.
    pub pictures: &'a [FramePictures],
    /// Mean milliseconds a frame of each stage, in order.
    pub stages_ms: Vec<(&'static str, f64)>,
    /// Mean milliseconds a frame of everything.
    pub frame_ms: f64,
    /// What the reader should know besides, one sentence each.
    pub notes: Vec<String>,
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
    /// Time to impact of the nearest obstacle, or why there is none.
    pub impact: Result<TimeToImpact, NoObstacle>,
    /// `ok`, `partial`, `first`, or why there is no answer.
    pub status: String,
}

impl FrameRow {
    /// Whether there is an earlier frame to compare with, so that an answer is asked for.
    fn asks(&self) -> bool {
        self.status != FIRST
    }

    /// Component `i` of φ ± σ in metres and radians, if it is observed and finite.
    fn component(&self, i: usize) -> Option<(f64, f64)> {
        let motion = self.motion.as_ref().filter(|m| m.observed[i])?;
        let (value, sigma) = (motion.theta.mean[i], motion.theta.sigma(i));
        (value.is_finite() && sigma.is_finite()).then_some((value, sigma))
    }
}

impl Report<'_> {
    /// The abscissa of charts over time, one value a row, and its name: seconds since the first row, or
    /// the frame's number where times do not increase.
    fn abscissa(&self) -> (Vec<f64>, &'static str) {
        let times = self.frames.iter().map(|row| row.time_s);
        let increasing = times.clone().zip(times.clone().skip(1)).all(|(a, b)| b > a);
        match self.frames.first() {
            Some(first) if increasing && self.frames.iter().all(|row| row.time_s.is_finite()) => {
                (times.map(|t| t - first.time_s).collect(), "time (s)")
            }
            _ => (self.frames.iter().map(|row| row.frame as f64).collect(), "frame"),
        }
    }

    /// The pictures that the page shows: all, or evenly spaced ones.
    fn shown(&self) -> Vec<&FramePictures> {
        let step = self.pictures.len().div_ceil(MOST_PICTURES).max(1);
        self.pictures.iter().step_by(step).collect()
    }

    /// For each picture shown, the row whose φ starts at its frame.
    fn shown_rows(&self) -> Vec<Option<usize>> {
        self.shown().iter().map(|p| self.frames.iter().position(|row| row.frame > p.frame)).collect()
    }
}
