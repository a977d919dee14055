//! One sequence of a recording as its layout describes it: frames and their files, clock, rig and truth.

use std::fmt;
use std::path::PathBuf;

use egomotion::estimate::Tolerance;
use egomotion::geometry::{Camera, RigidMotion, StereoRectification, StereoRig};
use egomotion::pipeline::DepthNoise;
use serde::Serialize;

use super::disparity_file::DisparityFile;

/// The depth camera of a sequence, whose depth images lie on the left image's pixels.
///
/// [`Sequence::rig`] is then its rig: where it has no second camera, one with a virtual baseline.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DepthSensor {
    /// How noisy its depth is.
    pub noise: DepthNoise,
    /// Scale of 16-bit depth images, in levels per metre.
    pub levels_per_m: f64,
    /// Distortion of both images, which are warped by it when fetched.
    pub lens: Option<Camera>,
}

/// Consecutive stereo pairs of one rig.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Sequence {
    /// Name of the sequence or scene: the folder's name, or the scene's number.
    pub name: String,
    /// The frames in order of time, never empty.
    pub frames: Vec<FrameFiles>,
    /// Where the time stamps come from.
    pub clock: Clock,
    /// The rectified rig; `None` where the layout has no calibration.
    pub rig: Option<StereoRig>,
    /// How the images are rectified to that rig; `None` where they are.
    pub rectification: Option<StereoRectification>,
    /// What took the depth images; `None` where the layout has none.
    pub depth_sensor: Option<DepthSensor>,
    /// How well the rig is known, as far as the layout tells; all zero is exact.
    pub tolerance: Tolerance,
    /// Whether each image file holds the left image and the right one side by side.
    pub side_by_side: bool,
    /// File of stereo tracks in place of images, for [`crate::tables::tracks`].
    pub tracks: Option<PathBuf>,
    /// True maps, where the layout has them.
    pub truth_files: Option<TruthFiles>,
}

impl Sequence {
    /// Frames of a rig, and nothing else known.
    pub(crate) fn new(name: String, frames: Vec<FrameFiles>, clock: Clock, rig: Option<StereoRig>) -> Self {
        Self {
            name,
            frames,
            clock,
            rig,
            rectification: None,
            depth_sensor: None,
            tolerance: Tolerance::default(),
            side_by_side: false,
            tracks: None,
            truth_files: None,
        }
    }
}

/// The files of one frame.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FrameFiles {
    /// Number of the frame in the source, as in the file's name.
    pub index: usize,
    /// Left image. The file of a lost frame does not exist: reading it fails, and the frame keeps its place.
    pub left: PathBuf,
    /// Right image; `None` if it is missing.
    pub right: Option<PathBuf>,
    /// Depth image on the left image's pixels, a file for [`crate::maps::depth`]; `None` if there is none.
    pub depth: Option<PathBuf>,
    /// Time stamp, in seconds; strictly increasing.
    pub time_s: f64,
    /// True pose of the left camera, `world_from_camera`, if known.
    pub truth: Option<RigidMotion>,
}

/// Where time stamps come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Clock {
    /// Read from the source.
    Measured,
    /// Assumed, because the source has none.
    Assumed {
        /// Time from one frame to the next, in seconds.
        interval_s: f64,
    },
}

/// True maps of one frame of a scene; each is `None` where its file is missing.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct TruthFiles {
    /// The frame that they belong to, by [`FrameFiles::index`].
    pub index: usize,
    /// Disparity at this frame.
    pub disparity: Option<DisparityFile>,
    /// Disparity at the next frame of this frame's pixels.
    pub next_disparity: Option<DisparityFile>,
    /// Flow to the next frame, a file for [`crate::maps::flow_png`].
    pub flow: Option<PathBuf>,
}

impl fmt::Display for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Measured => f.write_str("measured"),
            Self::Assumed { interval_s } => write!(f, "assumed, {interval_s} s a frame"),
        }
    }
}
