//! From images to measurements, each with its uncertainty.

pub mod flow;
pub mod pyramid;
