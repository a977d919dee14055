//! Section 7.2: the manipulator's sequences, or a recording, through the whole image pipeline.
//!
//! [`LabStudy`] repeats Tables 3 to 7 and Figures 11 to 14 on rendered sequences, with the paper's values beside ours
//! and maximum likelihood beside both. A [`Triple`] of frames gives the same records for a recording, and
//! [`publish_recording`] the same tables and figures; errors need its true poses.
//!
//! Choices. The differential approach is the paper's own: derivatives at t, d_t = ½ (d(t+1) − d(t−1)), and the image
//! velocity at t as half the displacement from t−1 to t+1 in the left and in the right image, so that both are of
//! the same order in the motion. The discrete approach compares t with t+1. The paper's methods get disparity
//! rounded to 1/16 px, as its matcher gave it; maximum likelihood is the library's pipeline on the images of t and
//! t+1, with all its defaults. φ is estimated from all that is matched, wrong matches too; the truth only decides at
//! which pixels VZ is compared.

mod contender;
mod depth_velocity;
mod estimates;
mod lab;
mod matching;
mod printed;
mod publish;
mod quantity;
mod record;
mod recording;
mod rendered;
mod statistics;

use thiserror::Error;

pub use contender::{ImageContender, ImageEstimator};
pub use estimates::MatchingSettings;
pub use lab::LabStudy;
pub use matching::MatchingError;
pub use quantity::Quantity;
pub use record::{DrawId, RealRecord};
pub use recording::{ShownFrames, Triple, publish_recording};

use crate::sequences::NoSequence;
use egomotion::pipeline::PipelineError;

/// Why there are no records.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RealError {
    /// There is no such sequence, or the images have no pixels.
    #[error(transparent)]
    Sequence(#[from] NoSequence),
    /// The images are not of the rig's size.
    #[error("the images are of {found:?} pixels, the rig of {expected:?}")]
    Size {
        /// Width and height of the images, in pixels.
        found: (usize, usize),
        /// Width and height of the rig's images, in pixels.
        expected: (usize, usize),
    },
    /// The images could not be matched.
    #[error(transparent)]
    Matching(#[from] MatchingError),
    /// The pipeline refuses the rig.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}
