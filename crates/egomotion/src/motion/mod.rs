//! What the motion of pixels means: depth velocity and time to impact, each with its uncertainty.

pub mod depth_velocity;
