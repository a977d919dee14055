//! From frames to motion: the one place where all steps meet.

pub mod config;
mod contested;
mod frame_pair;
pub mod groups;
mod map_row;
pub mod maps;
mod moving;
pub mod solve;
pub mod stereo;
pub mod trajectory;

pub use config::{Approach, Config, ConfigError, EstimatorKind, Method, Observe, meaning};
pub use groups::MovingGroup;
pub use stereo::{FrameMotion, StereoFrame, StereoMotion, Unanswered};
pub use trajectory::Trajectory;
