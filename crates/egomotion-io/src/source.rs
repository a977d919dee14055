//! What a SOURCE folder holds: its layout, frames, time stamps, rig and truth.

mod euroc;
mod feature_tracks;
mod karlsruhe;
mod kitti_odometry;
mod kitti_raw;
mod kitti_scenes;
mod listing;
mod middlebury;
mod moments;
mod plain;
mod tartanair;
mod true_disparity;
mod tum_rgbd;

use std::fmt;
use std::path::{Path, PathBuf};

use egomotion::estimate::Tolerance;
use egomotion::geometry::{Camera, RigidMotion, StereoRectification, StereoRig};
use egomotion::pipeline::DepthNoise;
use serde::Serialize;

use crate::IoError;
pub use true_disparity::{DisparityEncoding, TrueDisparity};

/// A recognised recording: one sequence, or a set of independent scenes.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Source {
    /// The folder, as it was given.
    pub path: PathBuf,
    /// The dataset layout.
    pub layout: Layout,
    /// Why the folder was taken for this layout.
    pub reason: String,
    /// The sequences, never empty; no motion is made between two of them.
    pub sequences: Vec<Sequence>,
}

/// A dataset layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Layout {
    /// `image_0`, `image_1` (or `image_2`, `image_3`), `calib.txt`, perhaps `times.txt` and poses.
    KittiOdometry,
    /// A raw drive, synchronised and rectified: `image_00/data`, `image_01/data` (or 02, 03), perhaps `oxts`.
    KittiRaw,
    /// The stereo and flow set of 2012: grey scenes `image_0`, `image_1`, `calib/`.
    KittiStereoFlow2012,
    /// The scene flow set of 2015: colour scenes `image_2`, `image_3`, `calib_cam/`.
    KittiSceneFlow2015,
    /// `mav0/cam0`, `mav0/cam1`: raw images with time stamps in nanoseconds.
    Euroc,
    /// The same of TUM-VI's fisheye cameras.
    TumVi,
    /// `image_0`, `image_1`, `calib.txt` and `insdata.txt`.
    Karlsruhe,
    /// TUM's RGB-D set: `rgb.txt`, `depth.txt`, perhaps `groundtruth.txt`.
    TumRgbd,
    /// A trajectory of TartanAir 1: `image_left`, `depth_left`, perhaps `image_right` and `pose_left.txt`.
    TartanAirV1,
    /// A trajectory of TartanAir 2: `image_lcam_front`, `depth_lcam_front`, perhaps `image_rcam_front`.
    TartanAirV2,
    /// Stereo tracks with their rig in an `.npz`, and no images.
    FeatureTracks,
    /// Pairs without a second time, as in the Middlebury sets.
    StereoPairs,
    /// Folders `left` and `right`, or images and `depth`, or images side by side, and a calibration.
    Plain,
}

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
    /// File of stereo tracks in place of images, for [`crate::tracks`].
    pub tracks: Option<PathBuf>,
    /// True maps, where the layout has them.
    pub truth_maps: Option<TruthMaps>,
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
            truth_maps: None,
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
    /// Depth image on the left image's pixels, a file for [`crate::depth`]; `None` if there is none.
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
pub struct TruthMaps {
    /// The frame that they belong to, by [`FrameFiles::index`].
    pub index: usize,
    /// Disparity at this frame.
    pub disparity: Option<TrueDisparity>,
    /// Disparity at the next frame of this frame's pixels.
    pub next_disparity: Option<TrueDisparity>,
    /// Flow to the next frame, a file for [`crate::flow_png`].
    pub flow: Option<PathBuf>,
}

/// The layouts for error messages.
const KNOWN: &str = "known layouts: KITTI odometry (image_0, image_1 or image_2, image_3, and calib.txt), \
                     KITTI 2012 and 2015 scenes (training/ with image_0, image_1 or image_2, image_3), \
                     EuRoC and TUM-VI (mav0/cam0, mav0/cam1), \
                     TUM RGB-D (rgb.txt, depth.txt), TartanAir (image_lcam_front or image_left), \
                     stereo tracks (one .npz with features, K, b), stereo pairs (im2, im6 …), \
                     a plain folder (left, right or rgb, depth, and rig.toml)";

/// Interval of the KITTI cameras, assumed where there are no time stamps, in seconds.
const KITTI_INTERVAL_S: f64 = 0.1;

impl Source {
    /// Recognise a folder and list what it holds. Images are not decoded.
    ///
    /// # Errors
    /// The folder is missing, empty or of no known layout; it has no left or no right images; its
    /// calibration or time stamps are missing or wrong. The error names the file and the line.
    pub fn open(path: &Path) -> Result<Self, IoError> {
        Self::open_with(path, None)
    }

    /// The same with another calibration file in place of the source's own.
    ///
    /// # Errors
    /// As [`Source::open`]; and what is wrong with the calibration file.
    pub fn open_with(path: &Path, calibration: Option<&Path>) -> Result<Self, IoError> {
        let folder = path.canonicalize().map_err(|error| IoError::system(path, "open", &error))?;
        if let (true, Some((layout, reason, sequences))) =
            (folder.is_file(), feature_tracks::recognise(&folder, calibration)?)
        {
            return Ok(Self { path: path.to_owned(), layout, reason, sequences });
        }
        if !folder.is_dir() {
            return Err(IoError::new(
                path,
                "is not a folder",
                format_args!("give a sequence folder; {KNOWN}"),
            ));
        }
        let mut recognised = None;
        for layout in [
            kitti_scenes::recognise,
            euroc::recognise,
            karlsruhe::recognise,
            kitti_odometry::recognise,
            kitti_raw::recognise,
            tum_rgbd::recognise,
            tartanair::recognise,
            feature_tracks::recognise,
            middlebury::recognise,
            plain::recognise,
        ] {
            recognised = layout(&folder, calibration)?;
            if recognised.is_some() {
                break;
            }
        }
        let (layout, reason, sequences) = recognised.ok_or_else(|| unknown(path, &folder))?;
        Ok(Self { path: path.to_owned(), layout, reason, sequences })
    }
}

/// What the recognition of a layout gives: layout, reason, sequences.
type Recognised = (Layout, String, Vec<Sequence>);

fn unknown(path: &Path, folder: &Path) -> IoError {
    let empty = folder.read_dir().is_ok_and(|mut entries| entries.next().is_none());
    let reason = if empty {
        "is an empty folder"
    } else if plain::holds_images_only(folder) {
        "holds images of one camera: depth needs a second one, or depth images"
    } else {
        "has no layout that is known"
    };
    IoError::new(path, reason, KNOWN)
}

impl Layout {
    /// Whether it is a set of independent scenes.
    pub fn is_scene_set(self) -> bool {
        matches!(self, Self::KittiStereoFlow2012 | Self::KittiSceneFlow2015)
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::KittiOdometry => "KITTI odometry",
            Self::KittiRaw => "KITTI raw",
            Self::KittiStereoFlow2012 => "KITTI stereo and flow 2012",
            Self::KittiSceneFlow2015 => "KITTI scene flow 2015",
            Self::Euroc => "EuRoC",
            Self::TumVi => "TUM-VI",
            Self::Karlsruhe => "Karlsruhe",
            Self::TumRgbd => "TUM RGB-D",
            Self::TartanAirV1 => "TartanAir 1",
            Self::TartanAirV2 => "TartanAir 2",
            Self::FeatureTracks => "stereo tracks",
            Self::StereoPairs => "stereo pairs",
            Self::Plain => "plain folder",
        })
    }
}

impl fmt::Display for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Measured => f.write_str("measured"),
            Self::Assumed { interval_s } => write!(f, "assumed, {interval_s} s a frame"),
        }
    }
}
