//! What a pipeline keeps of the frames that it has seen, without their images: small enough for a file.
//!
//! The memory has no fixed length in frames: a corner may be followed as long as it is seen. So an interrupted
//! sequence does not go on by pushing its last few frames again, but from here, and then to the same bits.

use serde::{Deserialize, Serialize};

use super::given_tracks::TrackPoint;
use crate::geometry::Twist;
use crate::observe::tracks::StereoCorner;

/// The memory of a [`super::StereoMotion`]; what is computed of its reference frame alone is computed again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StereoMemory {
    pub(super) frames: usize,
    pub(super) last_time_s: Option<f64>,
    pub(super) reference: Option<KeptFrame>,
    pub(super) velocity: Option<Twist>,
    pub(super) failures: usize,
}

/// The frame that the next one is matched with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct KeptFrame {
    pub(super) frame: usize,
    pub(super) time_s: f64,
    /// Corners that were followed here.
    pub(super) corners: Vec<StereoCorner>,
}

impl StereoMemory {
    /// Index of the frame that the next one is matched with, counted over all frames pushed or skipped.
    pub fn reference(&self) -> Option<usize> {
        self.reference.as_ref().map(|reference| reference.frame)
    }
}

/// The memory of a [`super::TrackMotion`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrackMemory {
    pub(super) frames: usize,
    pub(super) last_time_s: Option<f64>,
    /// Index, time and points of the frame that the next one is compared with.
    pub(super) reference: Option<(usize, f64, Vec<TrackPoint>)>,
    pub(super) velocity: Option<Twist>,
    pub(super) failures: usize,
}
