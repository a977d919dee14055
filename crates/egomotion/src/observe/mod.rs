//! From images to observations, each with its covariance.

pub mod corners;
pub mod disparity;
pub mod flow;
pub mod observation;
pub mod patch;
pub mod pyramid;
pub mod row_disagreement;
pub mod sample;
pub mod spline;
pub mod tracks;

pub use disparity::{DisparityMap, DisparityMatcher, DisparityOptions};
pub use flow::{FlowField, FlowOptions, dense_flow};
pub use observation::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};
pub use pyramid::Pyramid;
pub use sample::DensePair;
pub use tracks::{StereoPyramid, TrackOptions};
