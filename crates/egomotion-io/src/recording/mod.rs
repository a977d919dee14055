//! The frames of a sequence as they are read: which of them, from what, and what turns them into motion.

mod ahead;
mod pipeline;
mod reader;

use std::path::{Path, PathBuf};

use egomotion::estimate::Tolerance;
use egomotion::geometry::{Grid, RigidMotion, StereoRig};
use egomotion::pipeline::PipelineError;
use egomotion::pipeline::{Config, Frame, Observe, TrackPoint, Unanswered};

use crate::source::{FrameFiles, Sequence};
use crate::{ChoiceError, IoError, image, tracks};
pub use ahead::{read_ahead, with_frames};
pub use pipeline::{Memory, Pipeline, RecallError};
pub use reader::{Reader, halves, unseen};

/// One frame as it comes out of its files.
#[derive(Debug)]
pub struct Fetched {
    /// Index of the frame in the source.
    pub index: usize,
    /// Its time, in seconds.
    pub time_s: f64,
    /// What is given of this time, or why it cannot be used.
    pub frame: Result<Given, Unanswered>,
    /// True pose world_from_camera.
    pub truth: Option<RigidMotion>,
    /// Spent on reading, in milliseconds.
    pub decode_ms: f64,
    /// Size of its files together; 0 where there are none.
    pub bytes: u64,
}

/// What is given of one time.
#[derive(Debug)]
pub enum Given {
    /// Images, and perhaps maps.
    Frame(Box<Frame>),
    /// Points of tracks that others made.
    Tracks(Vec<TrackPoint>),
}

/// Which images give the depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// Left and right ones.
    Stereo,
    /// Depth images.
    Depth,
}

/// What is taken of a sequence.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Choice {
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

/// Frames of a sequence, ready to be read.
#[derive(Debug)]
pub struct Recording {
    /// The rig on whose pixels the results lie.
    pub rig: StereoRig,
    /// The frames with their times, which increase also when playing backwards.
    pub frames: Vec<(FrameFiles, f64)>,
    /// Pixels of the left and of the right image never to use.
    pub masks: [Option<Grid<bool>>; 2],
    tolerance: Tolerance,
    reader: Reader,
}

impl Recording {
    /// What is chosen of a sequence of the source at `path`, which errors name.
    ///
    /// # Errors
    /// The choice does not fit the sequence; it has no calibration; tracks or mask cannot be read.
    pub fn open(path: &Path, sequence: &Sequence, choice: &Choice) -> Result<Self, ChoiceError> {
        let frames = select(path, sequence, choice)?;
        let no_rig = || IoError::new(path, "no calibration", "give one with --calibration FILE");
        let rig = sequence.rig.ok_or_else(no_rig)?;
        let tracks = choice.tracks.as_deref().or(sequence.tracks.as_deref()).map(tracks::read).transpose()?;
        if tracks.is_some() && (choice.disparity.is_some() || choice.flow.is_some()) {
            return Err(ChoiceError::Choice("disparity and flow need images, not tracks".into()));
        }
        let reader = Reader {
            disparity: choice.disparity.clone(),
            flow: choice.flow.clone(),
            tracks,
            ..Reader::new(sequence, sensor(path, sequence, choice)? == Sensor::Depth)
        };
        let mask = choice.mask.as_deref().map(|path| read_mask(path, &rig)).transpose()?;
        let [left, right] = unseen(reader.rectifier.as_ref());
        let tolerance = sequence.tolerance;
        Ok(Self { rig, frames, masks: [joined(mask, left), right], tolerance, reader })
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there are none; there are at least two.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Read the k-th of the chosen frames; `None` past the end.
    pub fn fetch(&self, k: usize) -> Option<Fetched> {
        let (files, time_s) = self.frames.get(k)?;
        Some(self.reader.read(files, *time_s, k + 1 == self.frames.len()))
    }

    /// Size of the k-th frame's files together.
    pub fn bytes(&self, k: usize) -> u64 {
        self.frames.get(k).map_or(0, |(files, _)| self.reader.bytes(files))
    }

    /// Whether it holds tracks and no images.
    pub fn is_of_tracks(&self) -> bool {
        self.reader.tracks.is_some()
    }

    /// Whether depth images take the place of right ones.
    pub fn is_of_depth(&self) -> bool {
        self.reader.depth.is_some()
    }

    /// The settings as they apply to it: tracks are sparse, whatever was asked for, and images have the tolerance of what
    /// took them unless the settings have one.
    pub fn config(&self, config: &Config) -> Config {
        if self.is_of_tracks() {
            return Config { observe: Observe::Sparse, ..config.clone() };
        }
        match &self.reader.depth {
            Some((camera, _)) => camera.noise.tolerated(config.clone()),
            None if config.tolerance.is_exact() => Config { tolerance: self.tolerance, ..config.clone() },
            None => config.clone(),
        }
    }

    /// What turns its frames into motion.
    ///
    /// # Errors
    /// The rig cannot measure, or the settings do not fit together.
    pub fn pipeline(&self, config: &Config) -> Result<Pipeline, PipelineError> {
        let masks = self.masks.clone();
        Pipeline::new(self.rig, self.config(config), self.is_of_tracks(), masks)
    }
}

/// Depth images take the place of right ones where there are no others, or where that is asked for.
fn sensor(path: &Path, sequence: &Sequence, choice: &Choice) -> Result<Sensor, ChoiceError> {
    let has_right = sequence.side_by_side || sequence.frames.iter().any(|frame| frame.right.is_some());
    let (has, wanted) = match choice.sensor {
        Some(Sensor::Depth) => (sequence.depth_sensor.is_some(), "depth images"),
        Some(Sensor::Stereo) => (has_right, "right images"),
        None => return Ok(if has_right { Sensor::Stereo } else { Sensor::Depth }),
    };
    let words = || ChoiceError::Choice(format!("{}: has no {wanted}", path.display()));
    choice.sensor.filter(|_| has).ok_or_else(words)
}

fn select(path: &Path, sequence: &Sequence, choice: &Choice) -> Result<Vec<(FrameFiles, f64)>, ChoiceError> {
    let all = &sequence.frames;
    if all.len() == 1 {
        return Err(IoError::new(path, "has one frame only", "motion needs at least two").into());
    }
    if choice.start >= all.len() {
        let words = format!("start {} is past the last of {} frames", choice.start, all.len());
        return Err(ChoiceError::Choice(words));
    }
    let stride = choice.stride.unwrap_or(1).max(1);
    let chosen = all[choice.start..].iter().step_by(stride).take(choice.frames.unwrap_or(usize::MAX));
    let mut frames: Vec<(FrameFiles, f64)> = chosen.map(|frame| (frame.clone(), frame.time_s)).collect();
    if frames.len() < 2 {
        let words = format!("{} frame is selected; motion needs at least two", frames.len());
        return Err(ChoiceError::Choice(words));
    }
    if choice.reverse {
        frames.reverse();
        let last = frames[0].1;
        frames.iter_mut().for_each(|(_, time)| *time = last - *time);
    }
    Ok(frames)
}

fn read_mask(path: &Path, rig: &StereoRig) -> Result<Grid<bool>, IoError> {
    let mask = image::read(path)?;
    let ((w, h), (we, he)) = (mask.size(), (rig.width_px, rig.height_px));
    if (w, h) != (we, he) {
        let reason = format!("the mask is {w}x{h} pixels, the images {we}x{he}");
        return Err(IoError::new(path, reason, "give one of the images' size"));
    }
    Ok(Grid::from_fn(w, h, |u, v| mask.at(u, v) > 0.0))
}

/// Pixels that either mask excludes.
fn joined(mask: Option<Grid<bool>>, unseen: Option<Grid<bool>>) -> Option<Grid<bool>> {
    let (Some(mut mask), Some(unseen)) = (mask.clone(), &unseen) else { return mask.or(unseen) };
    mask.values_mut().iter_mut().zip(unseen.values()).for_each(|(masked, unseen)| *masked |= unseen);
    Some(mask)
}
