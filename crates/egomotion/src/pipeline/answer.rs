//! What the pipeline answers to a frame: its motion and what follows from it, or why there is none.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::interpret::{MotionMaps, MovingGroup};
use super::solve::{Contradiction, PairMotion};
use super::stages::StageTimes;
use crate::estimate::{CovarianceParts, LastMotion, MotionEstimate, Unsolvable};
use crate::geometry::RigErrors;
use crate::motion::{NoObstacle, Obstacle, TimeToImpact};
use crate::observe::{DisparityMap, FlowField};

/// Dense results of a frame pair, on the earlier frame's pixel grid.
#[derive(Debug, Clone)]
pub struct DenseResults {
    /// Disparity of the earlier frame.
    pub disparity: DisparityMap,
    /// Flow of the left camera to the later frame.
    pub flow: FlowField,
    /// VZ and time to impact.
    pub motion: MotionMaps,
}

/// What one frame says about motion since its reference frame.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FrameMotion {
    /// This frame's index, counted over all frames pushed or skipped.
    pub frame: usize,
    /// The earlier frame that it was matched with.
    pub reference: Option<usize>,
    /// Time of this frame, in seconds.
    pub time_s: f64,
    /// Time since the reference, in seconds.
    pub dt_s: Option<f64>,
    /// φ over that interval with all of its uncertainty, or why there is none.
    pub motion: Result<MotionEstimate, Unanswered>,
    /// The parts of the covariance of φ; `None` without φ.
    pub parts: Option<CovarianceParts>,
    /// Standard deviations of the rig's errors that the covariance allows for.
    pub rig_sigma: RigErrors,
    /// By how much matches of left and right lie on different rows in the reference frame, in pixels:
    /// how well the pair is rectified.
    pub row_disagreement_px: Option<f64>,
    /// Where tracked corners contradict the answer of a linear method.
    pub contradiction: Option<Contradiction>,
    /// The nearest obstacle that will pass through the vehicle's window, or why there is none.
    pub obstacle: Result<Obstacle, NoObstacle>,
    /// What moves by itself, the largest group first; found when observing densely.
    pub moving: Vec<MovingGroup>,
    /// The maps, when observing densely; not kept where this is written to a file.
    #[serde(skip)]
    pub dense: Option<DenseResults>,
    /// Where the time went.
    pub stages: StageTimes,
}

impl FrameMotion {
    /// No answer for a frame, beside the reference frame if there is one.
    pub(super) fn unanswered(
        (frame, time_s): (usize, f64),
        reference: Option<(usize, f64)>,
        why: Unanswered,
    ) -> Self {
        Self {
            frame,
            reference: reference.map(|(frame, _)| frame),
            time_s,
            dt_s: reference.map(|(_, before_s)| time_s - before_s),
            motion: Err(why),
            parts: None,
            rig_sigma: RigErrors::default(),
            row_disagreement_px: None,
            contradiction: None,
            obstacle: Err(NoObstacle::NothingMeasured),
            moving: Vec::new(),
            dense: None,
            stages: StageTimes::default(),
        }
    }

    /// What two frames, each with its time in seconds, say about the motion between them.
    pub(super) fn of_pair(
        (reference, before_s): (usize, f64),
        (frame, time_s): (usize, f64),
        pair: PairAnswer,
        dense: Option<DenseResults>,
        stages: StageTimes,
    ) -> Self {
        Self {
            frame,
            reference: Some(reference),
            time_s,
            dt_s: Some(time_s - before_s),
            parts: pair.motion.as_ref().ok().map(|motion| motion.parts),
            rig_sigma: pair.rig_sigma,
            motion: pair.motion.map(|motion| motion.estimate),
            row_disagreement_px: pair.row_disagreement_px,
            contradiction: pair.contradiction,
            obstacle: pair.obstacle,
            moving: pair.moving,
            dense,
            stages,
        }
    }

    /// Time to impact of the nearest obstacle.
    pub fn impact(&self) -> Option<TimeToImpact> {
        self.obstacle.as_ref().ok().map(|obstacle| obstacle.impact)
    }
}

/// What is found between two frames.
pub(super) struct PairAnswer {
    pub(super) motion: Result<PairMotion, Unanswered>,
    /// What the next pair needs of the motion.
    pub(super) last: Option<LastMotion>,
    pub(super) rig_sigma: RigErrors,
    pub(super) row_disagreement_px: Option<f64>,
    pub(super) contradiction: Option<Contradiction>,
    pub(super) obstacle: Result<Obstacle, NoObstacle>,
    pub(super) moving: Vec<MovingGroup>,
}

impl PairAnswer {
    /// Nothing, for a reason.
    pub(super) fn none(why: Unsolvable) -> Self {
        Self {
            motion: Err(why.into()),
            last: None,
            rig_sigma: RigErrors::default(),
            row_disagreement_px: None,
            contradiction: None,
            obstacle: Err(NoObstacle::NothingMeasured),
            moving: Vec::new(),
        }
    }
}

/// Why there is no answer for a frame.
#[derive(Debug, Clone, PartialEq, Eq, Error, Serialize, Deserialize)]
pub enum Unanswered {
    /// There is no earlier frame to compare with.
    #[error("no earlier frame")]
    First,
    /// The images cannot be used.
    #[error("{0}")]
    BadImage(String),
    /// The right image is missing.
    #[error("the right image is missing")]
    MissingRight,
    /// The depth image is missing.
    #[error("the depth image is missing")]
    MissingDepth,
    /// The given disparity map is missing.
    #[error("the disparity map is missing")]
    MissingDisparity,
    /// The given flow map is missing.
    #[error("the flow map is missing")]
    MissingFlow,
    /// The frame is a copy of the one before: a sensor's noise never repeats itself.
    #[error("it repeats the frame before")]
    RepeatedFrame,
    /// The time stamp does not lie after that of the frame before.
    #[error("the time stamp does not increase")]
    BadTime,
    /// The images gave no solvable equations.
    #[error(transparent)]
    Unsolvable(#[from] Unsolvable),
}

impl Unanswered {
    /// One word for tables.
    pub fn code(&self) -> &'static str {
        match self {
            Self::First => "first",
            Self::BadImage(_) => "bad_image",
            Self::MissingRight => "missing_right",
            Self::MissingDepth => "missing_depth",
            Self::MissingDisparity => "missing_disparity",
            Self::MissingFlow => "missing_flow",
            Self::RepeatedFrame => "repeated_frame",
            Self::BadTime => "bad_time",
            Self::Unsolvable(Unsolvable::FewRows { .. }) => "few_rows",
            Self::Unsolvable(Unsolvable::Unobservable) => "unobservable",
            Self::Unsolvable(Unsolvable::NotFinite) => "not_finite",
            Self::Unsolvable(Unsolvable::NotConverged) => "not_converged",
        }
    }
}
