//! The library, seen from outside.
#![allow(missing_docs)]

mod coverage;
mod disparity;
mod equations;
mod flow;
mod given_tracks;
mod groups;
mod jacobians;
mod masks;
mod memory;
mod metrics;
mod observability;
mod obstacle;
mod pipeline;
mod recovery;
mod relative_pose;
mod rendered;
mod rgbd;
mod rig_errors;
mod scattered;
mod sim;
mod tracks;
