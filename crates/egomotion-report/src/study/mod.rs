//! The paper's studies: each figure as an SVG, and `page.html`, which shows figures and tables.

pub mod figure;
pub mod page;
mod table;
