//! From images to measurements, each with its standard deviation.

pub mod disparity;
