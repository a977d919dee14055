//! EuRoC's layout, `mav0/cam0`, `mav0/cam1` with time stamps in nanoseconds; that of TUM-VI, whose lenses
//! are fisheyes and whose calibration lies in `dso/camchain.yaml`, is the same.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use egomotion::geometry::{Distortion, RigidMotion, StereoRectification};

use super::Recognised;
use crate::calibration::{self, CameraPair, StereoCalibration, euroc, kalibr};
use crate::source::layout::DatasetLayout;
use crate::source::listing;
use crate::source::sequence::{Clock, FrameFiles, Sequence};
use crate::source::timestamps::interpolated_pose;
use crate::tables::trajectory::{self, TrajectoryFormat};
use crate::{IoError, read};

/// Longest time between a left image and its right one, in nanoseconds: the cameras are triggered together, and frames
/// are 50 ms apart.
const MAX_PAIR_DELAY_NS: i64 = 2_000_000;

/// Longest time between two true poses over which they are interpolated, in seconds; longer gaps leave a frame without
/// truth.
const MAX_POSE_GAP_S: f64 = 0.1;

/// Image files by time stamp in nanoseconds.
type ImagesByTime = BTreeMap<i64, PathBuf>;

/// The folder as a recording of two cameras; `None` if it holds no `mav0/cam0/data`.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let Some((top, mav)) = places(folder)? else { return Ok(None) };
    let cameras = ["cam0", "cam1"].map(|name| mav.join(name));
    let (left, right) = (images(&cameras[0])?, images(&cameras[1])?);
    let data = cameras.each_ref().map(|camera| camera.join("data"));
    let named = "TIMESTAMP.png, listed in data.csv";
    listing::check_both((&data[0], left.is_empty()), (&data[1], right.is_empty()), named)?;

    let mut frames = together(&data[0], &left, &right);
    let (file, calibration) = match calibration {
        Some(file) => (file.to_owned(), calibration::read(file)?),
        None => own_calibration(&top, &cameras)?,
    };
    let only: Vec<FrameFiles> = frames.iter().map(|(_, frame)| frame.clone()).collect();
    let pair = calibration.pair(CameraPair::Grey, listing::image_size(&only)?, &file)?;
    let body_from_left = match &calibration {
        StereoCalibration::Raw(raw) => raw.body_from_left,
        _ => None,
    };
    add_truth(&mut frames, (&top, &mav), body_from_left, pair.rectification.as_ref())?;
    let name = top.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let frames = frames.into_iter().map(|(_, frame)| frame).collect();
    let sequence = Sequence {
        rectification: pair.rectification,
        ..Sequence::new(name, frames, Clock::Measured, Some(pair.rig))
    };
    let fisheye = sequence.rectification.as_ref().is_some_and(|pair| {
        [pair.left(), pair.right()].iter().all(|c| matches!(c.distortion(), Distortion::Equidistant { .. }))
    });
    let (layout, lens) =
        if fisheye { (DatasetLayout::TumVi, " of fisheye cameras") } else { (DatasetLayout::Euroc, "") };
    let reason = format!("it holds cam0 and cam1 with time stamps in nanoseconds{lens}");
    Ok(Some(Recognised { layout, reason, sequences: vec![sequence] }))
}

/// The recording's folder and its `mav0`, given either, or a folder that holds one recording.
fn places(folder: &Path) -> Result<Option<(PathBuf, PathBuf)>, IoError> {
    let is_mav = |mav: &Path| mav.join("cam0/data").is_dir() || mav.join("cam0/data.csv").is_file();
    let within =
        |top: &Path| Some(top.join("mav0")).filter(|mav| is_mav(mav)).map(|mav| (top.to_owned(), mav));
    if is_mav(folder) {
        let top = folder.parent().filter(|_| folder.ends_with("mav0")).unwrap_or(folder);
        return Ok(Some((top.to_owned(), folder.to_owned())));
    }
    if let Some(found) = within(folder) {
        return Ok(Some(found));
    }
    let failed = |error: std::io::Error| IoError::system(folder, "list", &error);
    let mut found = Vec::new();
    for entry in folder.read_dir().map_err(failed)? {
        found.extend(within(&entry.map_err(failed)?.path()));
    }
    if found.len() > 1 {
        found.sort();
        let reason = format_args!("holds {} recordings", found.len()).to_string();
        return Err(IoError::new(folder, reason, format_args!("give one, as {}", found[0].0.display())));
    }
    Ok(found.pop())
}

/// The images that `data.csv` lists, or those in `data/` without it.
fn images(camera: &Path) -> Result<ImagesByTime, IoError> {
    let (data, list) = (camera.join("data"), camera.join("data.csv"));
    if !list.is_file() {
        let nanoseconds = |stem: &str| listing::digits(stem).and_then(|ns| i64::try_from(ns).ok());
        return listing::numbered(&data, nanoseconds);
    }
    let text = read::text(&list)?;
    let mut images = ImagesByTime::new();
    for (line, content) in read::lines(&text) {
        let refuse =
            |reason: &str| IoError::new(&list, reason, "give rows of `nanoseconds,file name`").at_line(line);
        let (stamp, name) = content.split_once(',').ok_or_else(|| refuse("the row has no comma"))?;
        let stamp: i64 = stamp.trim().parse().map_err(|_| refuse("the time stamp is no whole number"))?;
        // Only the name: a list must not lead out of its folder.
        let name = Path::new(name.trim()).file_name().ok_or_else(|| refuse("the row has no file name"))?;
        if images.insert(stamp, data.join(name)).is_some() {
            return Err(refuse("the time stamp is there twice"));
        }
    }
    Ok(images)
}

/// Frames in order of time, each with the right image of its time; a frame that lacks one keeps its place.
fn together(left_data: &Path, left: &ImagesByTime, right: &ImagesByTime) -> Vec<(i64, FrameFiles)> {
    let near = |images: &ImagesByTime, stamp: i64| {
        let around =
            images.range(stamp.saturating_sub(MAX_PAIR_DELAY_NS)..=stamp.saturating_add(MAX_PAIR_DELAY_NS));
        around.min_by_key(|(other, _)| other.abs_diff(stamp)).map(|(_, file)| file.clone())
    };
    let alone = right.keys().filter(|stamp| near(left, **stamp).is_none());
    let mut stamps: Vec<i64> = left.keys().chain(alone).copied().collect();
    stamps.sort_unstable();
    let frame = |(index, stamp): (usize, i64)| {
        let right = near(right, stamp).filter(|file| file.is_file());
        // A lost left image has the name that its time gives.
        let lost = || left_data.join(format!("{stamp}.png"));
        let left = left.get(&stamp).cloned().unwrap_or_else(lost);
        (stamp, FrameFiles { index, left, right, depth: None, time_s: stamp as f64 * 1e-9, truth: None })
    };
    stamps.into_iter().enumerate().map(frame).collect()
}

/// The calibration that comes with the recording, and its file.
fn own_calibration(top: &Path, cameras: &[PathBuf; 2]) -> Result<(PathBuf, StereoCalibration), IoError> {
    let sensors = cameras.each_ref().map(|camera| camera.join("sensor.yaml"));
    let chains = ["dso/camchain.yaml", "camchain.yaml"].map(|name| top.join(name));
    if let Some(chain) = chains.into_iter().find(|file| !sensors[0].is_file() && file.is_file()) {
        let pair = kalibr::read(&chain)?;
        return Ok((chain, StereoCalibration::Raw(pair)));
    }
    let [left, right] = sensors;
    let pair = euroc::read_pair(&left, &right).map_err(|error| {
        let advice = format!("{}; or give a calibration with --calibration FILE", error.advice);
        IoError { advice, ..error }
    })?;
    Ok((left, StereoCalibration::Raw(pair)))
}

/// Put the true pose of the rectified left camera on the frames that have one.
fn add_truth(
    frames: &mut [(i64, FrameFiles)],
    (top, mav): (&Path, &Path),
    body_from_left: Option<RigidMotion>,
    rectification: Option<&StereoRectification>,
) -> Result<(), IoError> {
    let bodies = ["state_groundtruth_estimate0/data.csv", "mocap0/data.csv"].map(|name| mav.join(name));
    let body = bodies.into_iter().find(|file| file.is_file()).zip(body_from_left);
    let camera = top.join("groundtruth_cam0.txt");
    let (poses, carried_from_left) = match body {
        Some((file, body_from_left)) => {
            (trajectory::read(&file, Some(TrajectoryFormat::Euroc))?, body_from_left)
        }
        None if camera.is_file() => {
            (trajectory::read(&camera, Some(TrajectoryFormat::Tum))?, RigidMotion::identity())
        }
        None => return Ok(()),
    };
    for (_, frame) in frames {
        let pose = interpolated_pose(&poses, frame.time_s, MAX_POSE_GAP_S);
        let world_from_left = pose.map(|pose| pose.after(&carried_from_left));
        frame.truth = world_from_left.map(|pose| {
            rectification.map_or(pose, |rectification| rectification.world_from_rectified(&pose))
        });
    }
    Ok(())
}
