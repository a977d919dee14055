//! What every chart and page is made of: axes, colours, numbers, small pictures, one look.

pub(crate) mod axes;
pub mod colour;
pub(crate) mod document;
pub mod number;
pub(crate) mod raster;
