//! What the motion of pixels means: depth velocity and time to impact, each with its uncertainty.

pub mod depth_velocity;
pub mod impact;
pub mod obstacle;
mod rigid_prediction;

pub use depth_velocity::DepthVelocity;
pub use impact::TimeToImpact;
pub use obstacle::{NoObstacle, Obstacle};
