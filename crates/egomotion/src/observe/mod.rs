//! From images to observations, each with its covariance.

pub mod corners;
pub mod observation;
pub mod patch;
pub mod pyramid;
pub mod tracks;

pub use observation::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};
pub use pyramid::Pyramid;
pub use tracks::{StereoPyramid, TrackOptions};
