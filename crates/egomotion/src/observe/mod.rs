//! From images to observations, each with its covariance.

pub mod corners;
mod depth_alignment;
pub mod disparity;
pub mod flow;
mod follow;
pub mod observation;
pub mod patch;
pub(crate) mod planes;
pub mod pyramid;
pub mod rectifier;
pub mod row_disagreement;
mod row_search;
pub mod sample;
pub mod spline;
pub mod stereo_pyramid;
pub mod temporal_disparity;
pub mod tracks;
mod window;

pub use disparity::{DisparityMap, DisparityMatcher, DisparityOptions};
pub use flow::{FlowField, FlowOptions, dense_flow};
pub use observation::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};
pub use pyramid::Pyramid;
pub use rectifier::{RectificationMap, Rectifier};
pub use sample::DensePair;
pub use stereo_pyramid::StereoPyramid;
pub use tracks::TrackOptions;
