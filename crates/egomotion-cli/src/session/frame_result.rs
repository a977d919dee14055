//! What came out of one frame.

use egomotion::geometry::Twist;
use egomotion::pipeline::FrameMotion;
use serde::{Deserialize, Serialize};

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
