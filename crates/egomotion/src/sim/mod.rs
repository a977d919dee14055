//! A synthetic world whose every answer is known: textured rooms, rendered for a moving stereo rig.
//!
//! [`Scene`] → [`View`] (images and exact truth at one pose) → [`SensorNoise`]; a [`Sequence`] strings the
//! poses together. The world's frame is that of the cyclopean camera at time 0: X right, Y down, Z forward.

pub mod blur;
pub mod depth_sensing;
pub mod noise;
pub mod render;
pub mod scene;
pub mod scene_file;
pub mod sequences;
pub mod shape;
pub mod texture;
pub mod truth;
pub mod truth_maps;

pub use depth_sensing::{DepthPrinciple, DepthSensing};
pub use noise::{SensorError, SensorNoise};
pub use render::{StereoImages, View};
pub use scene::{Hit, Part, Scene};
pub use scene_file::SceneError;
pub use sequences::{Sequence, reference_pose};
pub use shape::{Shape, Turn};
pub use texture::Texture;
pub use truth::{MotionTruth, PointTruth, field_of};
pub use truth_maps::TruthMaps;
