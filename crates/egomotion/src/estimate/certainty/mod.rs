//! How certain an estimate is: its covariance by blocks, and which directions of motion are observed.

pub mod blocks;
pub mod observability;
pub mod undetermined;
