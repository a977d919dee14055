//! From frames to motion: the one place where all steps meet.
//!
//! [`StereoMotion`], [`RgbdMotion`] and [`TrackMotion`] take one frame after the other. [`Config`] holds every choice;
//! from it a [`plan::Plan`] follows once, and two frames are compared step by step as it says: observe, solve for φ,
//! interpret. What goes on from frame to frame is one value, [`Memory`].

mod answer;
pub mod config;
mod depth_camera;
mod former_keys;
mod frame;
mod frame_pair;
mod interpret;
mod memory;
pub mod plan;
mod shared;
pub mod solve;
mod stages;
mod stereo_motion;
mod track_motion;
mod trajectory;

pub use answer::{DenseResults, FrameMotion, Unanswered};
pub use config::{Approach, Config, ConfigError, EstimatorKind, Method, Observe, PipelineError, meaning};
pub use depth_camera::{DepthCamera, DepthNoise, RgbdMotion, VIRTUAL_BASELINE_M};
pub use former_keys::former_key_advice;
pub use frame::{Frame, StereoFrame};
pub use interpret::{MotionMaps, MovingGroup, motion_maps};
pub use memory::Memory;
pub use stages::StageTimes;
pub use stereo_motion::{StereoMemory, StereoMotion};
pub use track_motion::{TrackMemory, TrackMotion, TrackPoint};
pub use trajectory::{RelativePose, Trajectory};
