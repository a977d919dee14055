//! The layout of KITTI's odometry set: one folder, one sequence.

use std::path::{Path, PathBuf};

use egomotion::geometry::RigidMotion;
use nalgebra::{Matrix3, Vector3};

use super::{KITTI_INTERVAL_S, Recognised};
use crate::calibration::{self, CameraPair, KittiCalibration, StereoCalibration};
use crate::source::layout::DatasetLayout;
use crate::source::listing;
use crate::source::sequence::{Clock, FrameFiles, Sequence};
use crate::tables::trajectory::{self, TrajectoryFormat};
use crate::{IoError, read};

/// The folder as an odometry sequence; `None` if it has no `image_0` … `image_3`.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let Some(pair) = pair_of(folder) else { return Ok(None) };
    let [left_folder, right_folder] = image_folders(folder, pair);
    let left = listing::numbered(&left_folder, listing::digits)?;
    let right = listing::numbered(&right_folder, listing::digits)?;
    listing::check_both(
        (&left_folder, left.is_empty()),
        (&right_folder, right.is_empty()),
        "000000.png, 000001.png …",
    )?;
    let mut frames = listing::pairs(&left_folder, &left, &right);

    let own = folder.join("calib.txt");
    let file = calibration.unwrap_or(&own);
    let calibration = match calibration {
        Some(file) => calibration::read(file)?,
        None => StereoCalibration::Kitti(KittiCalibration::read(file)?),
    };
    let rectified = calibration.pair(pair, listing::image_size(&frames)?, file)?;
    let clock = stamp(&mut frames, &folder.join("times.txt"))?;
    if let Some(poses) = poses_file(folder) {
        let centre = match &calibration {
            StereoCalibration::Kitti(kitti) => kitti.left_centre(pair)?,
            _ => Vector3::zeros(),
        };
        add_truth(&mut frames, &poses, centre)?;
        if let Some(rectification) = &rectified.rectification {
            let truths = frames.iter_mut().filter_map(|frame| frame.truth.as_mut());
            truths.for_each(|pose| *pose = rectification.world_from_rectified(pose));
        }
    }
    let [l, r] = pair.cameras();
    let reason = format!("it holds image_{l} and image_{r} with numbered PNG files");
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let sequence = Sequence {
        rectification: rectified.rectification,
        ..Sequence::new(name, frames, clock, Some(rectified.rig))
    };
    Ok(Some(Recognised { layout: DatasetLayout::KittiOdometry, reason, sequences: vec![sequence] }))
}

/// The grey pair if it is whole, else the colour pair if that is whole, else the one that has begun.
fn pair_of(folder: &Path) -> Option<CameraPair> {
    let pairs = [CameraPair::Grey, CameraPair::Colour];
    let has = |pair: &CameraPair| image_folders(folder, *pair).map(|f| f.is_dir());
    let whole = pairs.into_iter().find(|pair| has(pair) == [true, true]);
    whole.or_else(|| pairs.into_iter().find(|pair| has(pair) != [false, false]))
}

fn image_folders(folder: &Path, pair: CameraPair) -> [PathBuf; 2] {
    pair.cameras().map(|camera| folder.join(format!("image_{camera}")))
}

/// Row of frame `k`, number `index`, in a file of one row a frame.
///
/// As many rows as frames belong to them one by one; otherwise some images are not there, and rows
/// count from number 0.
fn row_of(rows: usize, frames: usize, k: usize, index: usize) -> usize {
    if rows == frames { k } else { index }
}

/// Put the time stamps of `times.txt` on the frames, or assumed ones if there is no such file.
fn stamp(frames: &mut [FrameFiles], file: &Path) -> Result<Clock, IoError> {
    if !file.exists() {
        let first = frames.first().map_or(0, |f| f.index);
        frames.iter_mut().for_each(|f| f.time_s = KITTI_INTERVAL_S * (f.index - first) as f64);
        return Ok(Clock::Assumed { interval_s: KITTI_INTERVAL_S });
    }
    let times = read_times(file)?;
    let count = frames.len();
    let mut last = f64::NEG_INFINITY;
    for (k, frame) in frames.iter_mut().enumerate() {
        let row = row_of(times.len(), count, k, frame.index);
        let Some(&(line, time_s)) = times.get(row) else {
            let reason =
                format_args!("ends after {} time stamps, image {} has none", times.len(), frame.index);
            let error = IoError::new(file, reason, "give one time stamp (s) a line for each image");
            return Err(error.at_line(times.last().map_or(1, |(line, _)| line + 1)));
        };
        if time_s <= last {
            let reason = format_args!("time {time_s} s does not come after {last} s");
            return Err(IoError::new(file, reason, "give time stamps that increase").at_line(line));
        }
        (frame.time_s, last) = (time_s, time_s);
    }
    Ok(Clock::Measured)
}

/// (line, time in seconds) of each row.
fn read_times(file: &Path) -> Result<Vec<(usize, f64)>, IoError> {
    let text = read::text(file)?;
    let time = |(line, word)| {
        let refuse = |reason| IoError::new(file, reason, "give one time stamp (s) a line").at_line(line);
        read::number(word).map(|time| (line, time)).map_err(refuse)
    };
    read::lines(&text).map(time).collect()
}

/// `poses.txt` inside, or `poses/NAME.txt` beside `sequences/NAME`.
fn poses_file(folder: &Path) -> Option<PathBuf> {
    let beside = || {
        let sequences = folder.parent().filter(|p| p.file_name().is_some_and(|name| name == "sequences"))?;
        let name = format!("{}.txt", folder.file_name()?.to_str()?);
        Some(sequences.parent()?.join("poses").join(name))
    };
    [Some(folder.join("poses.txt")), beside()].into_iter().flatten().find(|file| file.is_file())
}

/// Put true poses on the frames that have one. Files hold those of camera 0, whose frame has the
/// left camera's `centre`, in metres.
fn add_truth(frames: &mut [FrameFiles], file: &Path, centre: Vector3<f64>) -> Result<(), IoError> {
    let poses = trajectory::read(file, Some(TrajectoryFormat::Kitti))?;
    let zero_from_left = RigidMotion { rotation: Matrix3::identity(), translation: centre };
    let count = frames.len();
    for (k, frame) in frames.iter_mut().enumerate() {
        let pose = poses.get(row_of(poses.len(), count, k, frame.index));
        frame.truth = pose.map(|pose| pose.world_from_camera.after(&zero_from_left));
    }
    Ok(())
}
