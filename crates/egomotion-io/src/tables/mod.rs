//! Tables, one row for each frame: motion, poses, points of tracks.

#[cfg(feature = "parquet")]
pub mod motion_parquet;
pub mod motion_table;
pub mod tracks;
pub mod trajectory;
pub mod trajectory_covariance;
