//! Errors that all observations of a sensor share, and their part in the covariance.

pub mod augmented;
pub mod systematic;
pub mod tolerance;
