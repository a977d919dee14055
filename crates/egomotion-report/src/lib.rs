//! Reports of `egomotion`: plain values in, SVG and HTML out.
//!
//! [`run`] makes the page of a run, [`study`] the figures and the page of the paper's studies; both draw with
//! [`chart`]. Nothing here reads or writes a file.
#![deny(missing_docs)]
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod chart;
pub mod run;
pub mod study;
