//! What the motion of pixels means: depth velocity, time to impact and the nearest obstacle, each with its uncertainty.

pub mod depth_velocity;
mod impact;
mod obstacle;
mod rigid_prediction;
mod scaled_depth;
mod vehicle;

pub use depth_velocity::DepthVelocity;
pub use impact::TimeToImpact;
pub(crate) use obstacle::nearest_obstacle;
pub use obstacle::{NoObstacle, Obstacle, ObstacleCriteria, Sightings};
pub use rigid_prediction::{RigUncertainty, RigidPrediction};
pub use scaled_depth::{rotation_left_out, scaled_depth};
pub use vehicle::Vehicle;
