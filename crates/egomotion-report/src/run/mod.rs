//! `report.html`: a run as one self-contained page, made to be looked at.
//!
//! [`render`] turns plain values into the page; it reads and writes nothing. Pictures are compressed while the
//! run goes on ([`Album`]), so that neither maps nor images are kept.

mod album;
mod body;
mod bytes;
mod charts;
mod data;
mod impact;
mod index;
mod observed;
mod outlines;
mod page;
mod phi;
mod pictures;
mod player;
mod position;
mod series;
mod summary;
mod tables;
#[cfg(test)]
mod tests;
mod trajectory;
mod trouble;
mod viewer;

use egomotion::estimate::MotionEstimate;
use egomotion::geometry::{RigidMotion, StereoRig, Twist};
use egomotion::motion::{NoObstacle, Obstacle, TimeToImpact};
use egomotion::pipeline::MovingGroup;

pub use album::Album;
pub use index::{Scene, render as render_index};
pub use page::render;
pub use pictures::FramePictures;

/// Status of a frame that has no earlier one to compare with; it does not count as unanswered.
const FIRST: &str = "first";

/// Most places of the slider where there are no pictures.
const MOST_STOPS: usize = 200;

/// Half the width of a 95 % band, in σ; the same as in the command's verdicts.
const BAND: f64 = 2.0;

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
    pub eyes: Eyes,
    /// Whether corners alone were followed, so that there are no maps.
    pub sparse: bool,
    /// Whether every frame was done.
    pub complete: bool,
    /// One row a frame, in order.
    pub frames: &'a [FrameRow],
    /// world_from_camera, one a row.
    pub poses: &'a [RigidMotion],
    /// True poses, one a row; brought to the first estimated pose before they are drawn.
    pub truth: Option<&'a [RigidMotion]>,
    /// Pictures of some frames, in order.
    pub album: &'a Album,
    /// Mean milliseconds a frame of each stage, in order.
    pub stages_ms: Vec<(&'static str, f64)>,
    /// Mean milliseconds a frame of everything.
    pub frame_ms: f64,
    /// What the reader should know besides, one sentence each.
    pub notes: Vec<String>,
}

/// What a recording was made with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Eyes {
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

/// A value, and from where to where it lies with 95 %; the far end may be infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Interval {
    value: f64,
    low: f64,
    high: f64,
}

impl Interval {
    /// The band around a value.
    fn around(value: f64, sigma: f64) -> Self {
        Self { value, low: value - BAND * sigma, high: value + BAND * sigma }
    }

    /// Seconds to impact; `None` where nothing approaches.
    fn of_impact(impact: &TimeToImpact) -> Option<Self> {
        let (value, (low, high)) = impact.seconds().zip(impact.interval95_s())?;
        (value.is_finite() && low.is_finite() && !high.is_nan()).then_some(Self { value, low, high })
    }
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

    /// The interval of φ, if it is one.
    fn interval_s(&self) -> Option<f64> {
        self.dt_s.filter(|dt| dt.is_finite() && *dt > 0.0)
    }

    /// Time to impact of the nearest obstacle.
    fn impact(&self) -> Option<Interval> {
        Interval::of_impact(&self.obstacle.ok()?.impact)
    }
}

/// A place of the slider: a row, and its picture if there is one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stop {
    row: usize,
    picture: Option<usize>,
}

impl Report<'_> {
    /// Time of each row and the axis' name: seconds since the first row, or the frame's number where times do
    /// not increase.
    fn times(&self) -> (Vec<f64>, &'static str) {
        let times = self.frames.iter().map(|row| row.time_s);
        let increasing = times.clone().zip(times.clone().skip(1)).all(|(a, b)| b > a);
        match self.frames.first() {
            Some(first) if increasing && self.frames.iter().all(|row| row.time_s.is_finite()) => {
                (times.map(|t| t - first.time_s).collect(), "time (s)")
            }
            _ => ((0..self.frames.len()).map(|k| k as f64).collect(), "frame of the run"),
        }
    }

    /// Where the slider can stop: at each picture, or at some rows where there are none.
    fn stops(&self) -> Vec<Stop> {
        let pictured: Vec<Stop> = self
            .album
            .pictures()
            .iter()
            .enumerate()
            .filter(|(_, picture)| picture.row < self.frames.len())
            .map(|(k, picture)| Stop { row: picture.row, picture: Some(k) })
            .collect();
        if !pictured.is_empty() {
            return pictured;
        }
        let step = self.frames.len().div_ceil(MOST_STOPS).max(1);
        (1..self.frames.len()).step_by(step).map(|row| Stop { row, picture: None }).collect()
    }
}
