//! The dataset layouts by name.

use std::fmt;

/// Every layout in words, for the errors of a folder that has none of them.
pub(super) const KNOWN_LAYOUTS: &str = "known layouts: KITTI odometry (image_0, image_1 or image_2, image_3, and calib.txt), \
                     KITTI 2012 and 2015 scenes (training/ with image_0, image_1 or image_2, image_3), \
                     EuRoC and TUM-VI (mav0/cam0, mav0/cam1), \
                     TUM RGB-D (rgb.txt, depth.txt), TartanAir (image_lcam_front or image_left), \
                     stereo tracks (one .npz with features, K, b), stereo pairs (im2, im6 …), \
                     a plain folder (left, right or rgb, depth, and rig.toml)";

/// A dataset layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DatasetLayout {
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

impl DatasetLayout {
    /// Whether it is a set of independent scenes.
    pub fn is_scene_set(self) -> bool {
        matches!(self, Self::KittiStereoFlow2012 | Self::KittiSceneFlow2015)
    }
}

impl fmt::Display for DatasetLayout {
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
