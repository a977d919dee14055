//! Cameras, the stereo rig, rigid motion, dense fields, Gaussians and quantiles: what everything else stands on.
//!
//! The module imports nothing from the rest of the crate.

mod camera;
mod cayley;
mod distortion;
pub mod distribution;
pub(crate) mod gaussian;
mod grid;
pub(crate) mod order_statistics;
mod perspective;
mod rectification;
mod regions;
mod rig;
mod rig_errors;
mod twist;

pub use camera::{Camera, CameraError};
pub use cayley::CayleyMotion;
pub use distortion::Distortion;
pub use gaussian::{Gaussian, rounding_variance};
pub use grid::{Field, Grid, Image};
pub use order_statistics::{median, upper_median};
pub use perspective::{image_flow, image_velocity};
pub use rectification::{RectificationError, StereoRectification};
pub(crate) use regions::Cells;
pub use regions::PixelBounds;
pub use rig::{RigCamera, RigError, StereoRig};
pub use rig_errors::{RIG_ERRORS, RigErrors};
pub use twist::{RigidMotion, Twist};
