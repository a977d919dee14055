//! A plain folder: left and right images, or images and depth, in folders of their own, or left and right side by side.
//!
//! `rig.toml` beside them (or any other calibration file) has the calibration; it may also say
//!
//! ```toml
//! rate_hz = 30.0               # frames a second, where there is no times.txt; 10 without it
//! side_by_side = true          # each image holds the left one and the right one
//! depth_levels_per_m = 1000.0  # of 16-bit depth images
//! depth_sensor = "kinect"      # or "time-of-flight", "exact": how noisy depth is
//! ```

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use egomotion::geometry::StereoRig;
use egomotion::pipeline::{DepthNoise, VIRTUAL_BASELINE_M};
use serde::Deserialize;

use super::Recognised;
use crate::calibration::{self, CameraPair};
use crate::source::layout::DatasetLayout;
use crate::source::listing;
use crate::source::sequence::{Clock, DepthSensor, FrameFiles, Sequence};
use crate::tables::trajectory;
use crate::{IoError, image, read};

/// Names of the folders of left and right images, in the order in which they are looked for.
const STEREO_FOLDERS: [(&str, &str); 6] = [
    ("left", "right"),
    ("Left", "Right"),
    ("image_left", "image_right"),
    ("left_images", "right_images"),
    ("cam0", "cam1"),
    ("camera_left", "camera_right"),
];
/// Names of the folder of images beside `depth`, in the order in which they are looked for.
const IMAGE_FOLDERS_BESIDE_DEPTH: [&str; 6] = ["rgb", "color", "colour", "image", "images", "left"];
/// Frames a second where neither `times.txt` nor `rate_hz` tells: velocities and times to impact scale with it.
const DEFAULT_RATE_HZ: f64 = 10.0;
/// Levels of 16-bit depth images per metre where `rig.toml` has none: millimetres, which most depth cameras write.
const DEFAULT_LEVELS_PER_M: f64 = 1000.0;

/// What `rig.toml` says beside a stereo calibration.
#[derive(Debug, Default, Deserialize)]
struct RecordingKeys {
    rate_hz: Option<f64>,
    #[serde(default)]
    side_by_side: bool,
    depth_levels_per_m: Option<f64>,
    depth_sensor: Option<String>,
    focal_px: Option<f64>,
    focal_y_px: Option<f64>,
    cx_px: Option<f64>,
    cy_px: Option<f64>,
}

/// The folder as a plain recording; `None` if it holds no folders of the known names and no `rig.toml` beside images.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let toml = folder.join("rig.toml");
    let keys = if toml.is_file() { keys(&toml)? } else { RecordingKeys::default() };
    let given = calibration.unwrap_or(folder);
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let has = |name: &str| folder.join(name).is_dir();
    let stereo = STEREO_FOLDERS.into_iter().find(|(left, right)| has(left) && has(right));
    let images = IMAGE_FOLDERS_BESIDE_DEPTH.into_iter().find(|images| has(images) && has("depth"));
    let (sequence, reason) = if let Some((left, right)) = stereo {
        let frames = together(&folder.join(left), &folder.join(right), |f, right| f.right = Some(right))?;
        let pair = calibration::read(given)?.pair(CameraPair::Grey, listing::image_size(&frames)?, given)?;
        let rectification = pair.rectification;
        let sequence =
            Sequence { rectification, ..Sequence::new(name, frames, assumed(&keys), Some(pair.rig)) };
        (sequence, format!("it holds the folders {left} and {right}"))
    } else if let Some(images) = images {
        let frames = together(&folder.join(images), &folder.join("depth"), |f, depth| f.depth = Some(depth))?;
        let (rig, sensor) = depth_camera(calibration.unwrap_or(&toml), &frames)?;
        let sequence =
            Sequence { depth_sensor: Some(sensor), ..Sequence::new(name, frames, assumed(&keys), Some(rig)) };
        (sequence, format!("it holds the folders {images} and depth"))
    } else if keys.side_by_side {
        let frames = numbered(folder)?.into_iter().map(|(_, frame)| frame).collect::<Vec<_>>();
        let (width, height) = listing::image_size(&frames)?;
        let pair = calibration::read(given)?.pair(CameraPair::Grey, (width / 2, height), given)?;
        let rectification = pair.rectification;
        let whole = Sequence::new(name, frames, assumed(&keys), Some(pair.rig));
        let sequence = Sequence { rectification, side_by_side: true, ..whole };
        (sequence, "it holds images, and rig.toml says that left and right stand side by side".to_owned())
    } else {
        return Ok(None);
    };
    Ok(Some(Recognised { layout: DatasetLayout::Plain, reason, sequences: vec![dated(folder, sequence)?] }))
}

fn keys(file: &Path) -> Result<RecordingKeys, IoError> {
    let text = read::text(file)?;
    let keys: RecordingKeys = toml::from_str(&text).map_err(|error: toml::de::Error| {
        let line = error.span().map_or(1, |span| text[..span.start.min(text.len())].lines().count().max(1));
        IoError::new(file, error.message(), "correct the file").at_line(line)
    })?;
    match keys.rate_hz.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
        Some(rate) => {
            Err(IoError::new(file, format_args!("rate_hz: {rate} is not positive"), "correct the file"))
        }
        None => Ok(keys),
    }
}

fn assumed(keys: &RecordingKeys) -> Clock {
    Clock::Assumed { interval_s: keys.rate_hz.unwrap_or(DEFAULT_RATE_HZ).recip() }
}

/// The images of a folder by stem, as frames in the order of the last number in their names.
fn numbered(folder: &Path) -> Result<Vec<(String, FrameFiles)>, IoError> {
    let images = listing::numbered(folder, |stem| Some(stem.to_owned()))?;
    let mut images: Vec<(Option<usize>, String, PathBuf)> =
        images.into_iter().map(|(stem, path)| (last_number(&stem), stem, path)).collect();
    images.sort();
    let mut numbers: Vec<Option<usize>> = images.iter().map(|(number, ..)| *number).collect();
    numbers.dedup();
    // Numbers that tell the frames apart are their indices.
    let own = numbers.len() == images.len() && numbers.iter().all(Option::is_some);
    let frame = |(k, (number, stem, left)): (usize, (Option<usize>, String, PathBuf))| {
        let index = number.filter(|_| own).unwrap_or(k);
        (stem, FrameFiles { index, left, right: None, depth: None, time_s: 0.0, truth: None })
    };
    Ok(images.into_iter().enumerate().map(frame).collect())
}

/// The last run of digits in a name.
fn last_number(stem: &str) -> Option<usize> {
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    stem.get(start..end)?.parse().ok()
}

/// Frames of the first folder, each with its file of the second: the one of its name, or of its number, or, in
/// folders of as many files, of its place.
fn together(
    first: &Path,
    second: &Path,
    add: impl Fn(&mut FrameFiles, PathBuf),
) -> Result<Vec<FrameFiles>, IoError> {
    let frames = numbered(first)?;
    let others = depth_or_images(second)?;
    for (folder, empty) in [(first, frames.is_empty()), (second, others.is_empty())] {
        if empty {
            return Err(IoError::new(
                folder,
                "holds no image",
                "give images as PNG, JPEG, TIFF or PGM files",
            ));
        }
    }
    let by_number: BTreeMap<Option<usize>, &PathBuf> =
        others.iter().map(|(stem, path)| (last_number(stem), path)).collect();
    let in_order: Vec<&PathBuf> = others.values().collect();
    let unique = by_number.len() == others.len() && !by_number.contains_key(&None);
    let even = frames.len() == others.len();
    let pair = |(k, (stem, mut frame)): (usize, (String, FrameFiles))| {
        let named = others.get(&stem);
        let numbered = by_number.get(&last_number(&stem)).copied().filter(|_| unique);
        let placed = in_order.get(k).copied().filter(|_| even && !unique);
        if let Some(path) = named.or(numbered).or(placed) {
            add(&mut frame, path.clone());
        }
        frame
    };
    Ok(frames.into_iter().enumerate().map(pair).collect())
}

/// The images, or arrays of depth, of a folder by stem.
fn depth_or_images(folder: &Path) -> Result<BTreeMap<String, PathBuf>, IoError> {
    let images = listing::numbered(folder, |stem| Some(stem.to_owned()))?;
    if !images.is_empty() {
        return Ok(images);
    }
    listing::ending(folder, &["npy", "pfm"], |stem| Some(stem.to_owned()))
}

/// The virtual rig and the noise of a depth camera, from its `rig.toml`.
fn depth_camera(file: &Path, frames: &[FrameFiles]) -> Result<(StereoRig, DepthSensor), IoError> {
    let advice = "give rig.toml with focal_px, cx_px, cy_px, depth_levels_per_m and depth_sensor";
    let keys = keys(file)?;
    let refuse = |reason: String| IoError::new(file, reason, advice);
    let number =
        |name: &str, value: Option<f64>| value.ok_or_else(|| refuse(format!("the key {name} is missing")));
    let focal_px = number("focal_px", keys.focal_px)?;
    let centre = (number("cx_px", keys.cx_px)?, number("cy_px", keys.cy_px)?);
    let rig = StereoRig::new(focal_px, centre, VIRTUAL_BASELINE_M, listing::image_size(frames)?);
    let rig = rig.map(|rig| StereoRig { focal_y_px: keys.focal_y_px.unwrap_or(focal_px), ..rig });
    let rig = rig.and_then(|rig| rig.check().map(|()| rig)).map_err(|error| refuse(error.to_string()))?;
    let noise = match keys.depth_sensor.as_deref() {
        None | Some("kinect") => DepthNoise::kinect(),
        Some("time-of-flight") => DepthNoise::time_of_flight(),
        Some("exact") => DepthNoise::exact(),
        Some(other) => return Err(refuse(format!("depth_sensor: {other:?} is not known"))),
    };
    let levels_per_m = keys.depth_levels_per_m.unwrap_or(DEFAULT_LEVELS_PER_M);
    if !(levels_per_m.is_finite() && levels_per_m > 0.0) {
        return Err(refuse(format!("depth_levels_per_m: {levels_per_m} is not positive")));
    }
    Ok((rig, DepthSensor { noise, levels_per_m, lens: None }))
}

/// The sequence with the times of `times.txt` and the poses of `poses.txt`, where there are such files.
fn dated(folder: &Path, mut sequence: Sequence) -> Result<Sequence, IoError> {
    let count = sequence.frames.len();
    let times = ["times.txt", "timestamps.txt"].map(|name| folder.join(name));
    if let Some(file) = times.into_iter().find(|file| file.is_file()) {
        let stamps = times_of(&file)?;
        if stamps.len() != count {
            let reason = format_args!("has {} time stamps for {count} images", stamps.len()).to_string();
            return Err(IoError::new(&file, reason, "give one time stamp (s) a line for each image"));
        }
        sequence.frames.iter_mut().zip(stamps).for_each(|(frame, time_s)| frame.time_s = time_s);
        sequence.clock = Clock::Measured;
    } else if let Clock::Assumed { interval_s } = sequence.clock {
        let first = sequence.frames.first().map_or(0, |frame| frame.index);
        sequence.frames.iter_mut().for_each(|f| f.time_s = interval_s * f.index.saturating_sub(first) as f64);
    }
    let poses = folder.join("poses.txt");
    if poses.is_file() {
        let poses = trajectory::read(&poses, None)?;
        if poses.len() == count {
            let both = sequence.frames.iter_mut().zip(poses);
            both.for_each(|(frame, pose)| frame.truth = Some(pose.world_from_camera));
        }
    }
    Ok(sequence)
}

/// Increasing time stamps, the last number of each line.
fn times_of(file: &Path) -> Result<Vec<f64>, IoError> {
    let text = read::text(file)?;
    let advice = "give time stamps in seconds that increase, one a line";
    let mut last = f64::NEG_INFINITY;
    let time = |(line, content): (usize, &str)| {
        let refuse = |reason: String| IoError::new(file, reason, advice).at_line(line);
        let time = read::number(content.split_whitespace().last().unwrap_or_default()).map_err(refuse)?;
        if time <= last {
            return Err(refuse(format!("time {time} s does not come after {last} s")));
        }
        last = time;
        Ok(time)
    };
    read::lines(&text).map(time).collect()
}

/// Whether the folder holds images directly, and nothing that tells of a second camera.
pub(in crate::source) fn holds_images_only(folder: &Path) -> bool {
    let Ok(entries) = folder.read_dir() else { return false };
    entries.flatten().any(|entry| image::has_image_extension(&entry.path()))
}
