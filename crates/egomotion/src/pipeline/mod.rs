//! From frames to motion: the one place where all steps meet.

pub mod config;
mod contested;
pub mod frame;
mod frame_pair;
pub mod given_tracks;
pub mod groups;
mod map_row;
pub mod maps;
pub mod memory;
mod moving;
pub mod rgbd;
mod shape;
pub mod solve;
pub mod stereo;
mod track_solver;
pub mod trajectory;
pub mod unanswered;

pub use config::{Approach, Config, ConfigError, EstimatorKind, Method, Observe, meaning};
pub use frame::{Frame, StereoFrame};
pub use given_tracks::{TrackMotion, TrackPoint};
pub use groups::MovingGroup;
pub use memory::{StereoMemory, TrackMemory};
pub use rgbd::{DepthCamera, DepthNoise, RgbdMotion};
pub use stereo::{FrameMotion, StereoMotion};
pub use trajectory::Trajectory;
pub use unanswered::Unanswered;
