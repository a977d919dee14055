//! Images, datasets, calibration files, trajectories and maps for `egomotion`.
//!
//! | kind | modules |
//! |---|---|
//! | recordings | [`source`] (dataset layouts), [`calibration`], [`recording`] (frames for a pipeline), [`stream`] (images end to end) |
//! | images and maps | [`image`], [`depth`], [`disparity_png`], [`flow_png`], [`pfm`], [`flo`], [`npy`], [`ply`], [`precomputed`] |
//! | tables | [`motion_table`], [`trajectory`], [`trajectory_covariance`], [`tracks`] |
//! | whole tasks | [`simulation`] (a rendered sequence as a folder), [`evaluation`] (a trajectory against the truth) |
//!
//! Every reader comes twice: `read` takes a path, `decode` (or `parse`) takes what was read, so
//! that it also serves streams. No reader panics or allocates without bound on any input, and each
//! error is one line that names the file, the reason and what to do ([`IoError`]).
//!
//! ```no_run
//! use egomotion_io::{IoError, Source, image};
//!
//! let source = Source::open("sequences/06".as_ref())?;
//! for frame in &source.sequences[0].frames {
//!     let left = image::read(&frame.left)?;
//!     println!("{} s: {} x {} pixels", frame.time_s, left.width(), left.height());
//! }
//! # Ok::<(), IoError>(())
//! ```
#![deny(missing_docs)]
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod calibration;
mod error;
pub mod evaluation;
pub mod image;
mod maps;
pub mod read;
pub mod recording;
pub mod simulation;
pub mod source;
mod tables;
pub mod write;

pub use error::{IoError, OptionsError};
pub use image::stream;
pub use maps::{depth, disparity_png, flo, flow_png, npy, pfm, ply, precomputed};
pub use source::Source;
#[cfg(feature = "parquet")]
pub use tables::motion_parquet;
pub use tables::{motion_table, tracks, trajectory, trajectory_covariance};

/// The examples of the README, compiled with the doc tests; here because they need both libraries.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
