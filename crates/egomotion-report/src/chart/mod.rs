//! What every chart and page of this command is made of: scales, colours, numbers, small pictures, one look.

pub mod colour;
pub mod document;
pub mod number;
pub mod plot;
pub mod raster;
