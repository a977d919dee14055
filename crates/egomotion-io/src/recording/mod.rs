//! The frames of a sequence as they are read: which of them, from what, and what turns them into motion.

mod frame_reader;
mod options;
mod pipeline;
mod read_ahead;
mod source_frame;

use std::path::Path;

use egomotion::estimate::Tolerance;
use egomotion::geometry::{Grid, StereoRig};
use egomotion::pipeline::PipelineError;
use egomotion::pipeline::{Config, Observe};

use crate::source::{FrameFiles, Sequence};
use crate::tables::tracks;
use crate::{IoError, OptionsError, image};
pub use frame_reader::{Reader, halves, unseen};
pub use options::{RecordingOptions, Sensor};
use options::{select, sensor};
pub use pipeline::{Memory, Pipeline, RecallError};
pub use read_ahead::{read_ahead, with_frames};
pub use source_frame::{FrameInput, SourceFrame};

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
    /// The part of a sequence that the options choose, of the source at `path`, which errors name.
    ///
    /// # Errors
    /// The options do not fit the sequence; it has no calibration; tracks or mask cannot be read.
    pub fn open(path: &Path, sequence: &Sequence, options: &RecordingOptions) -> Result<Self, OptionsError> {
        let frames = select(path, sequence, options)?;
        let no_rig = || IoError::new(path, "no calibration", "give one with --calibration FILE");
        let rig = sequence.rig.ok_or_else(no_rig)?;
        let tracks =
            options.tracks.as_deref().or(sequence.tracks.as_deref()).map(tracks::read).transpose()?;
        if tracks.is_some() && (options.disparity.is_some() || options.flow.is_some()) {
            return Err(OptionsError::Invalid("disparity and flow need images, not tracks".into()));
        }
        let reader = Reader {
            disparity: options.disparity.clone(),
            flow: options.flow.clone(),
            tracks,
            ..Reader::new(sequence, sensor(path, sequence, options)? == Sensor::Depth)
        };
        let mask = options.mask.as_deref().map(|path| read_mask(path, &rig)).transpose()?;
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
    pub fn read_frame(&self, k: usize) -> Option<SourceFrame> {
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
