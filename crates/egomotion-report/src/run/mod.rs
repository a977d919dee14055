//! `report.html`: a run as one self-contained page, made to be looked at.
//!
//! [`render`] turns a [`Report`] of plain values into the page; it reads and writes nothing. Pictures are compressed
//! while the run goes on ([`Album`]), so that neither maps nor images are kept.

mod album;
mod base64_text;
mod body_velocity;
mod camera_path;
mod charts;
mod impact;
mod interval;
mod observability;
mod outlines;
mod page;
mod pictures;
mod player;
mod report;
mod scene_motion;
mod scene_set;
mod script_data;
mod slider;
mod summary;
mod tables;
#[cfg(test)]
mod tests;
mod time_series;
mod timeline;
mod viewer;
mod warnings;

pub use album::Album;
pub use page::render;
pub use pictures::FramePictures;
pub use report::{FrameRow, InputKind, Report};
pub use scene_set::{SceneSummary, render as render_index};
