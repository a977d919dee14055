//! What a session leaves behind.

use egomotion::geometry::RigidMotion;
use egomotion::pipeline::Trajectory;
use egomotion_report::run::Album;

use super::frame_result::FrameResult;
use super::run_log::RunLog;

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
