//! Images, datasets, calibration files, trajectories and maps for `egomotion`.
//!
//! Every reader comes twice: `read` takes a path, `decode` (or `parse`) takes what was read, so
//! that it also serves streams. No reader panics or allocates without bound on any input, and each
//! error is one line that names the file, the reason and what to do ([`IoError`]).
#![deny(missing_docs)]

pub mod calibration;
pub mod disparity_png;
pub mod error;
pub mod flo;
pub mod flow_png;
pub mod image;
pub mod pfm;
mod raster;
pub mod read;
pub mod source;
pub mod trajectory;
pub mod write;

pub use error::IoError;
pub use source::Source;
