//! A synthetic world whose every answer is known: textured rooms, rendered for a moving stereo rig.
//!
//! [`Scene`] → [`View`] (images and exact truth at one pose) → [`SensorNoise`]; a [`Sequence`] strings the
//! poses together. The world's frame is that of the cyclopean camera at time 0: X right, Y down, Z forward.

mod blur;
mod depth_sensing;
mod noise;
mod render;
mod scene;
mod sequences;
mod shape;
mod texture;
mod truth;
mod truth_maps;

pub use depth_sensing::{DepthPrinciple, DepthSensing};
pub use noise::{SensorError, SensorNoise};
pub use render::{StereoImages, View};
pub use scene::{Hit, Part, Scene, SceneError};

pub use sequences::{Sequence, paper_rig, reference_pose, twist_from_mm_deg};
pub use shape::{Shape, Turn};
pub use texture::Texture;
pub use truth::{MotionTruth, PointTruth, field_of};
pub use truth_maps::{IN_LATER, IN_RIGHT, TruthMaps};
