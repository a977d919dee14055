//! Which part of a sequence a recording is, and which sensor gives the depth.

use std::path::{Path, PathBuf};

use crate::source::{FrameFiles, Sequence};
use crate::{IoError, OptionsError};

/// Which images give the depth: the choice of `--sensor`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// Left and right ones.
    Stereo,
    /// Depth images.
    Depth,
}

/// Which frames of a sequence are taken, and what takes the place of its own images and maps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordingOptions {
    /// The first frame, counted from 0.
    pub start: usize,
    /// Most frames; `None` is all.
    pub frames: Option<usize>,
    /// Every n-th frame; `None` is every one.
    pub stride: Option<usize>,
    /// From the last to the first.
    pub reverse: bool,
    /// Which images give the depth; `None` is the right ones where there are any.
    pub sensor: Option<Sensor>,
    /// Folder of disparity maps that take the place of our own.
    pub disparity: Option<PathBuf>,
    /// Folder of flow maps that take the place of our own.
    pub flow: Option<PathBuf>,
    /// File of tracks that take the place of images.
    pub tracks: Option<PathBuf>,
    /// Image of the rig's size whose pixels above 0 are never used.
    pub mask: Option<PathBuf>,
}

/// Depth images take the place of right ones where there are no others, or where that is asked for.
pub(super) fn sensor(
    path: &Path,
    sequence: &Sequence,
    options: &RecordingOptions,
) -> Result<Sensor, OptionsError> {
    let has_right = sequence.side_by_side || sequence.frames.iter().any(|frame| frame.right.is_some());
    let (has, wanted) = match options.sensor {
        Some(Sensor::Depth) => (sequence.depth_sensor.is_some(), "depth images"),
        Some(Sensor::Stereo) => (has_right, "right images"),
        None => return Ok(if has_right { Sensor::Stereo } else { Sensor::Depth }),
    };
    let words = || OptionsError::Invalid(format!("{}: has no {wanted}", path.display()));
    options.sensor.filter(|_| has).ok_or_else(words)
}

/// The chosen frames with their times, which increase also when playing backwards.
pub(super) fn select(
    path: &Path,
    sequence: &Sequence,
    options: &RecordingOptions,
) -> Result<Vec<(FrameFiles, f64)>, OptionsError> {
    let all = &sequence.frames;
    if all.len() == 1 {
        return Err(IoError::new(path, "has one frame only", "motion needs at least two").into());
    }
    if options.start >= all.len() {
        let words = format!("start {} is past the last of {} frames", options.start, all.len());
        return Err(OptionsError::Invalid(words));
    }
    let stride = options.stride.unwrap_or(1).max(1);
    let chosen = all[options.start..].iter().step_by(stride).take(options.frames.unwrap_or(usize::MAX));
    let mut frames: Vec<(FrameFiles, f64)> = chosen.map(|frame| (frame.clone(), frame.time_s)).collect();
    if frames.len() < 2 {
        let words = format!("{} frame is selected; motion needs at least two", frames.len());
        return Err(OptionsError::Invalid(words));
    }
    if options.reverse {
        frames.reverse();
        let last = frames[0].1;
        frames.iter_mut().for_each(|(_, time)| *time = last - *time);
    }
    Ok(frames)
}
