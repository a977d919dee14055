//! `page.html`: what studies show, and each figure as a file of its own.

pub mod figure;
pub mod page;
mod table;
