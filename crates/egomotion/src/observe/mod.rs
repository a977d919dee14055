//! From images to observations, each with its covariance.
//!
//! - [`disparity`]: dense disparity of a rectified pair, each value with its standard deviation;
//! - [`flow`]: dense optical flow from one image to the next, each vector with its covariance;
//! - [`tracks`]: corners followed through the four images of two stereo frames;
//! - [`DensePair`]: disparity and flow of two frames read as the four kinds of observation ([`StereoTrack`] and its
//!   siblings), which `constrain` and `estimate` take;
//! - [`StereoPyramid`]: what all of them need of a frame, computed once;
//! - [`Rectifier`]: raw images turned into rectified ones.

mod corners;
pub mod disparity;
pub mod flow;
mod follow;
mod observation;
mod patch;
mod pyramid;
mod rectifier;
mod row_disagreement;
mod row_search;
mod sample;
mod spline;
mod stereo_pyramid;
pub(crate) mod temporal_disparity;
pub mod tracks;
mod window;

pub use disparity::{DisparityMap, DisparityMatcher, DisparityOptions};
pub use flow::{FlowField, FlowOptions, dense_flow};
pub use observation::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};
pub use pyramid::{Pyramid, smooth};
pub use rectifier::{RectificationMap, Rectifier};
pub use row_disagreement::row_disagreement;
pub use sample::{DensePair, GradientStencil};
pub use stereo_pyramid::StereoPyramid;
pub use tracks::TrackOptions;
