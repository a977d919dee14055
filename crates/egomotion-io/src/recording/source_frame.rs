//! One frame of a source as the pipeline takes it.

use egomotion::geometry::RigidMotion;
use egomotion::pipeline::{Frame, TrackPoint, Unanswered};

/// One frame as it comes out of its source: read from files, from a stream, or rendered.
#[derive(Debug)]
pub struct SourceFrame {
    /// Index of the frame in the source.
    pub index: usize,
    /// Its time, in seconds.
    pub time_s: f64,
    /// What the pipeline takes of this time, or why it cannot be used.
    pub input: Result<FrameInput, Unanswered>,
    /// True pose world_from_camera.
    pub truth: Option<RigidMotion>,
    /// Spent on reading, in milliseconds.
    pub decode_ms: f64,
    /// Size of its files together; 0 where there are none.
    pub bytes: u64,
}

/// What a pipeline takes of one time.
#[derive(Debug)]
pub enum FrameInput {
    /// Images, and perhaps maps.
    Images(Box<Frame>),
    /// Points of tracks that others made.
    Tracks(Vec<TrackPoint>),
}
