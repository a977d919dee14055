//! TartanAir, version 2 (`image_lcam_front` …) and version 1 (`image_left` …): one trajectory's folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use egomotion::estimate::Tolerance;
use egomotion::geometry::{RigidMotion, StereoRig};
use egomotion::pipeline::DepthNoise;
use nalgebra::Matrix3;

use super::Recognised;
use crate::IoError;
use crate::source::layout::DatasetLayout;
use crate::source::listing;
use crate::source::sequence::{Clock, DepthSensor, Sequence};
use crate::tables::trajectory::{self, Pose, TrajectoryFormat};

/// How a version names its files, and its camera.
struct Version {
    layout: DatasetLayout,
    /// The left camera's name, and the right one's.
    cameras: [&'static str; 2],
    depth_extension: &'static str,
    /// The published camera, for its own image size; pixel centres lie at integers.
    focal_px: f64,
}

/// Both versions of the set: the newer is looked for first.
const VERSIONS: [Version; 2] = [
    Version {
        layout: DatasetLayout::TartanAirV2,
        cameras: ["lcam_front", "rcam_front"],
        depth_extension: "png",
        focal_px: 320.0,
    },
    Version {
        layout: DatasetLayout::TartanAirV1,
        cameras: ["left", "right"],
        depth_extension: "npy",
        focal_px: 320.0,
    },
];

/// Distance between the cameras in metres, as the set publishes it for both versions.
const BASELINE_M: f64 = 0.25;
/// Time from frame to frame in seconds, assumed because the set has no time stamps; velocities and times to impact scale
/// with it.
const INTERVAL_S: f64 = 0.1;

/// The folder as a trajectory; `None` if it has no image folder of either version with images of its names.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    for version in &VERSIONS {
        let left = version.images(folder, 0)?;
        if left.is_empty() {
            continue;
        }
        if let Some(file) = calibration {
            return Err(IoError::new(file, "is not needed: TartanAir's camera is known", "leave it out"));
        }
        return version.recording(folder, &left).map(Some);
    }
    Ok(None)
}

impl Version {
    /// `000012_left.png` by number.
    fn images(&self, folder: &Path, side: usize) -> Result<BTreeMap<usize, PathBuf>, IoError> {
        let camera = self.cameras[side];
        let number = |stem: &str| listing::digits(stem.strip_suffix(camera)?.strip_suffix('_')?);
        listing::numbered(&folder.join(format!("image_{camera}")), number)
    }

    fn recording(&self, folder: &Path, left: &BTreeMap<usize, PathBuf>) -> Result<Recognised, IoError> {
        let camera = self.cameras[0];
        let right = self.images(folder, 1)?;
        let mut frames = listing::pairs(&folder.join(format!("image_{camera}")), left, &right);
        let depth_folder = folder.join(format!("depth_{camera}"));
        let has_depth = depth_folder.is_dir();
        if right.is_empty() && !has_depth {
            let advice = format!("give image_{} or depth_{camera} beside it", self.cameras[1]);
            return Err(IoError::new(folder, "holds neither right images nor depth", advice));
        }
        let poses_file = folder.join(format!("pose_{camera}.txt"));
        let poses = match poses_file.is_file() {
            true => trajectory::read(&poses_file, Some(TrajectoryFormat::TumWithoutTime))?,
            false => Vec::new(),
        };
        let first = frames.first().map_or(0, |f| f.index);
        let count = frames.len();
        for (k, frame) in frames.iter_mut().enumerate() {
            frame.time_s = INTERVAL_S * (frame.index - first) as f64;
            // A cut recording has as many poses as frames, or those of all frames from number 0.
            let row = if poses.len() == count { k } else { frame.index };
            frame.truth = poses.get(row).map(optical);
            let name = format!("{:06}_{camera}_depth.{}", frame.index, self.depth_extension);
            frame.depth = Some(depth_folder.join(name)).filter(|file| file.is_file());
        }
        let (width, height) = listing::image_size(&frames)?;
        let centre = ((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0);
        let rig = StereoRig::new(self.focal_px, centre, BASELINE_M, (width, height))
            .map_err(|error| IoError::new(folder, error, "give whole images"))?;
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let sensor = DepthSensor { noise: DepthNoise::exact(), levels_per_m: 1.0, lens: None };
        let sequence = Sequence {
            depth_sensor: has_depth.then_some(sensor),
            // The set gives a focal length by its field of view, 90°; its depth images say 320.5 px where that says 320.
            tolerance: Tolerance { scale: 0.0, ..Tolerance::rendered() },
            ..Sequence::new(name, frames, Clock::Assumed { interval_s: INTERVAL_S }, Some(rig))
        };
        let reason = format!("it holds image_{camera} with files named NUMBER_{camera}");
        Ok(Recognised { layout: self.layout, reason, sequences: vec![sequence] })
    }
}

/// Poses have the axes of a vehicle, (forward, right, down); cameras look along Z with X to the right.
fn optical(pose: &Pose) -> RigidMotion {
    let body_from_optical = Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let RigidMotion { rotation, translation } = pose.world_from_camera;
    RigidMotion { rotation: rotation * body_from_optical, translation }
}
