//! The geometry everything else stands on: cameras, the rig, rigid motion, perspective flow, dense
//! fields and Gaussians. Imports nothing from the rest of the crate.

pub mod camera;
pub mod gaussian;
pub mod grid;
pub mod perspective;
pub mod rectification;
pub mod regions;
pub mod rig;
pub mod twist;
mod upper_median;

pub use camera::{Camera, Distortion};
pub use gaussian::Gaussian;
pub use grid::{Field, Grid, Image};
pub use rectification::StereoRectification;
pub use regions::{Cells, PixelBounds};
pub use rig::{RigError, StereoRig};
pub use twist::{RigidMotion, Twist};
pub use upper_median::upper_median;
