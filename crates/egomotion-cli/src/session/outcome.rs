//! What a session leaves behind.

use egomotion::geometry::{RigidMotion, Twist};
use egomotion::pipeline::{FrameMotion, Trajectory};
use egomotion_report::run::Album;
use serde::{Deserialize, Serialize};

use super::run_log::RunLog;

/// One answered or unanswered frame; its maps are not kept.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FrameResult {
    /// Index of the frame in the source.
    pub index: usize,
    /// That of the earlier frame it was matched with.
    pub reference_index: Option<usize>,
    pub motion: FrameMotion,
    /// True φ over the same interval.
    pub truth: Option<Twist>,
}

/// What a session leaves behind.
pub struct Outcome {
    pub frames: Vec<FrameResult>,
    pub trajectory: Trajectory,
    /// True poses, relative to the first frame; only if every frame has one.
    pub truth: Option<Vec<RigidMotion>>,
    /// Pictures of some frames, for the report.
    pub album: Album,
    pub complete: bool,
    pub stages_ms: Vec<(&'static str, f64)>,
    pub frame_ms: f64,
    pub wall_s: f64,
    /// To be removed when the results of a complete session are written.
    pub log: Option<RunLog>,
}
