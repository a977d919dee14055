//! The layout of TUM's RGB-D set: `rgb.txt`, `depth.txt`, `groundtruth.txt`.

use std::path::Path;

use egomotion::geometry::{Camera, Distortion, StereoRig};
use egomotion::pipeline::{DepthNoise, VIRTUAL_BASELINE_M};

use super::Recognised;
use crate::source::layout::DatasetLayout;
use crate::source::listing;
use crate::source::sequence::{Clock, DepthSensor, FrameFiles, Sequence};
use crate::source::timestamps::{associate, interpolated_pose, read_stamped_files};
use crate::tables::trajectory::{self, TrajectoryFormat};
use crate::{IoError, read};

/// Longest time between an image and its depth image, in seconds: the default of the set's own `associate.py`.
const MAX_DEPTH_DELAY_S: f64 = 0.02;
/// Longest time between two true poses over which they are interpolated, in seconds. The set has some hundred poses a
/// second; longer gaps leave a frame without truth.
const MAX_POSE_GAP_S: f64 = 0.2;
/// Levels of the depth images per metre, as the set publishes it.
const LEVELS_PER_M: f64 = 5000.0;

/// The numbers of a calibration file, for the advice of its errors.
const EXPECTED_NUMBERS: &str = "fx fy cx cy in pixels and perhaps k1 k2 p1 p2 k3";
/// fx, fy, cx, cy and k1, k2, p1, p2, k3 of the colour cameras of freiburg1, 2 and 3, as the set publishes them.
///
/// Depth was registered to the colour images as they are, distorted: both are warped alike.
const FREIBURG_CAMERAS: [[f64; 9]; 3] = [
    [517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633],
    [520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172],
    [535.4, 539.2, 320.1, 247.6, 0.0, 0.0, 0.0, 0.0, 0.0],
];

/// The folder as a recording of a depth camera; `None` if it has no `rgb.txt` and `depth.txt`.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let [rgb, depth] = ["rgb.txt", "depth.txt"].map(|name| folder.join(name));
    if !(rgb.is_file() && depth.is_file()) {
        return Ok(None);
    }
    let (images, depths) = (read_stamped_files(&rgb)?, read_stamped_files(&depth)?);
    if images.is_empty() {
        return Err(IoError::new(&rgb, "lists no image", "give `time file` a line"));
    }
    let times = |files: &[(f64, _)]| files.iter().map(|(time, _)| *time).collect::<Vec<f64>>();
    let belonging = associate(&times(&images), &times(&depths), MAX_DEPTH_DELAY_S);
    let truth = match folder.join("groundtruth.txt") {
        file if file.is_file() => trajectory::read(&file, Some(TrajectoryFormat::Tum))?,
        _ => Vec::new(),
    };
    let frame = |(index, ((time_s, left), depth)): (usize, ((f64, _), Option<usize>))| FrameFiles {
        index,
        left,
        right: None,
        depth: depth.and_then(|k| depths.get(k)).map(|(_, path)| path.clone()),
        time_s,
        truth: interpolated_pose(&truth, time_s, MAX_POSE_GAP_S),
    };
    let frames: Vec<FrameFiles> = images.into_iter().zip(belonging).enumerate().map(frame).collect();
    let size = listing::image_size(&frames)?;
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (rig, lens) = camera(folder, &name, calibration, size)?;
    let sensor = DepthSensor { noise: DepthNoise::kinect(), levels_per_m: LEVELS_PER_M, lens };
    let sequence =
        Sequence { depth_sensor: Some(sensor), ..Sequence::new(name, frames, Clock::Measured, Some(rig)) };
    let reason = "it holds rgb.txt and depth.txt".to_owned();
    Ok(Some(Recognised { layout: DatasetLayout::TumRgbd, reason, sequences: vec![sequence] }))
}

/// By the given file, `calibration.txt`, or the number in the folder's name.
fn camera(
    folder: &Path,
    name: &str,
    calibration: Option<&Path>,
    size: (usize, usize),
) -> Result<(StereoRig, Option<Camera>), IoError> {
    let own = folder.join("calibration.txt");
    let file = calibration.or_else(|| own.is_file().then_some(&own));
    let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = match file {
        Some(file) => numbers(file)?,
        None => (1..=3)
            .find(|n| name.contains(&format!("freiburg{n}")) || name.contains(&format!("fr{n}_")))
            .and_then(|n| FREIBURG_CAMERAS.get(n - 1).copied())
            .ok_or_else(|| {
                IoError::new(
                    folder,
                    "its name does not tell the camera (freiburg1, 2 or 3)",
                    format_args!("give calibration.txt or --calibration FILE with {EXPECTED_NUMBERS}"),
                )
            })?,
    };
    let refuse = |reason: String| {
        IoError::new(file.unwrap_or(folder), reason, format_args!("give {EXPECTED_NUMBERS}"))
    };
    let rig = StereoRig::new(fx, (cx, cy), VIRTUAL_BASELINE_M, size);
    let rig = rig.map(|rig| StereoRig { focal_y_px: fy, ..rig });
    let rig = rig.and_then(|rig| rig.check().map(|()| rig)).map_err(|error| refuse(error.to_string()))?;
    if [k1, k2, p1, p2, k3].iter().all(|k| *k == 0.0) {
        return Ok((rig, None));
    }
    let lens = Distortion::RadialTangential { k: [k1, k2, k3], p: [p1, p2] };
    let lens = Camera::new((fx, fy), (cx, cy), lens, size).map_err(|error| refuse(error.to_string()))?;
    Ok((rig, Some(lens)))
}

/// The numbers of a file's first line, distortion 0 where it has none.
fn numbers(file: &Path) -> Result<[f64; 9], IoError> {
    let text = read::text(file)?;
    let refuse = |reason: String| IoError::new(file, reason, format_args!("give {EXPECTED_NUMBERS}"));
    let (line, content) = read::lines(&text).next().ok_or_else(|| refuse("holds no numbers".into()))?;
    let given = read::numbers(content).map_err(|reason| refuse(reason).at_line(line))?;
    if !matches!(given.len(), 4 | 8 | 9) {
        return Err(refuse(format!("has {} numbers, not 4, 8 or 9", given.len())).at_line(line));
    }
    let mut all = [0.0; 9];
    all.iter_mut().zip(&given).for_each(|(to, from)| *to = *from);
    Ok(all)
}
