//! What every chart and page of this command is made of: scales, colours, numbers, small pictures, one look.

pub mod colour;
pub mod number;
pub mod plot;
pub mod raster;

/// The look that all pages share; each page adds rules for its own parts.
pub const PAGE_STYLE: &str = include_str!("page.css");
