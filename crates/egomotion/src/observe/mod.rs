//! From images to observations, each with its covariance.

pub mod observation;

pub use observation::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};
