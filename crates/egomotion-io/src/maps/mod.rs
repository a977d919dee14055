//! Maps and point clouds, one file for each format: disparity, flow and depth, each pixel's value or missing.

pub mod depth;
pub mod disparity_png;
pub mod flo;
pub mod flow_png;
pub mod npy;
pub(crate) mod npz;
pub mod pfm;
pub mod ply;
pub mod precomputed;
