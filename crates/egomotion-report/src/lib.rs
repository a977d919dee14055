//! Reports of `egomotion`: plain values in, SVG and HTML out.
//!
//! - [`run`] makes the page of a run: [`run::render`] turns a [`run::Report`] into one self-contained HTML document.
//! - [`study`] makes the figures of the paper's studies, each an SVG, and the page that shows them.
//! - [`chart`] has the colours and words that both share, for whoever draws beside them.
//!
//! Nothing here reads or writes a file, and no page loads anything.
//!
//! ```
//! use egomotion_report::study::figure;
//! use egomotion_study::{Axis, Content, Figure, Line, Panel, Point, Series};
//!
//! // The error of φ over the noise of disparity, with the standard error of each point.
//! let points = [0.1, 0.2, 0.4].map(|noise_px| Point { x: noise_px, y: 3.0 * noise_px, standard_error: Some(0.05) });
//! let series = Series { name: "dcce".into(), line: Line::Solid, points: points.to_vec() };
//! let content = Content::Plot { x: Axis::linear("noise (px)"), y: Axis::linear("error (%)"), series: vec![series] };
//! let svg = figure::svg(&Figure {
//!     id: "figure-7".into(),
//!     title: "Error over noise".into(),
//!     caption: "Bars are two standard errors.".into(),
//!     columns: 1,
//!     panels: vec![Panel { title: "(a)".into(), content }],
//! });
//! assert!(svg.starts_with("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns="));
//! ```
#![deny(missing_docs)]
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod chart;
pub mod run;
pub mod study;
