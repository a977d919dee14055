//! What turns frames into motion: images or tracks.

use egomotion::geometry::{Grid, Image, StereoRig};
use egomotion::pipeline::PipelineError;
use egomotion::pipeline::{
    Config, FrameMotion, StereoMemory, StereoMotion, TrackMemory, TrackMotion, Unanswered,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::source_frame::{FrameInput, SourceFrame};

/// What turns frames of either kind into motion.
#[derive(Debug)]
pub enum Pipeline {
    /// Images.
    Images(Box<StereoMotion>),
    /// Tracks.
    Tracks(Box<TrackMotion>),
}

impl Pipeline {
    /// For images of a rig with the `masks` of left and right, or for `tracks`.
    ///
    /// # Errors
    /// The rig cannot measure, or the settings do not fit together.
    pub fn new(
        rig: StereoRig,
        config: Config,
        tracks: bool,
        [left, right]: [Option<Grid<bool>>; 2],
    ) -> Result<Self, PipelineError> {
        if tracks {
            return Ok(Self::Tracks(Box::new(TrackMotion::new(rig, config)?)));
        }
        let mut images = StereoMotion::new(rig, config)?;
        images.set_mask(left);
        images.set_right_mask(right);
        Ok(Self::Images(Box::new(images)))
    }

    /// The motion from the last good frame to the input of this time.
    pub fn push(&mut self, time_s: f64, input: Result<FrameInput, Unanswered>) -> FrameMotion {
        match (self, input) {
            (Self::Images(images), Ok(FrameInput::Images(frame))) => images.push(*frame),
            (Self::Tracks(tracks), Ok(FrameInput::Tracks(points))) => tracks.push(time_s, &points),
            (Self::Images(images), input) => images.skip(time_s, reason(input)),
            (Self::Tracks(tracks), input) => tracks.skip(time_s, reason(input)),
        }
    }

    /// The frame that the next one will be matched with, counted over all frames pushed.
    pub fn reference(&self) -> Option<usize> {
        match self {
            Self::Images(images) => images.reference(),
            Self::Tracks(tracks) => tracks.reference(),
        }
    }
}

/// What a pipeline keeps of the frames that it has seen.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Memory {
    /// Of images.
    Images(StereoMemory),
    /// Of tracks.
    Tracks(TrackMemory),
}

impl Pipeline {
    /// What it keeps of the frames so far.
    pub fn memory(&self) -> Memory {
        match self {
            Self::Images(images) => Memory::Images(images.memory()),
            Self::Tracks(tracks) => Memory::Tracks(tracks.memory()),
        }
    }

    /// Go on from a memory; the reference frame is read again, and its left image given back.
    ///
    /// # Errors
    /// The memory is not of such frames, or the reference frame cannot be read again.
    pub fn recall(
        &mut self,
        memory: Memory,
        read: impl Fn(usize) -> Option<SourceFrame>,
    ) -> Result<Option<Image>, RecallError> {
        match (self, memory) {
            (Self::Images(images), Memory::Images(memory)) => {
                let mut left = None;
                let reference = memory.reference_frame().unwrap_or_default();
                let again = |k| match read(k).map(|frame| frame.input) {
                    Some(Ok(FrameInput::Images(frame))) => {
                        if k == reference {
                            left = Some(frame.left.clone());
                        }
                        Ok(*frame)
                    }
                    Some(input) => Err(reason(input)),
                    None => Err(Unanswered::BadImage("it is no longer there".into())),
                };
                images.recall(memory, again).map_err(|why| RecallError::Frame { reference, why })?;
                Ok(left)
            }
            (Self::Tracks(tracks), Memory::Tracks(memory)) => {
                tracks.recall(memory);
                Ok(None)
            }
            _ => Err(RecallError::Kind),
        }
    }
}

/// Why a pipeline cannot go on from a memory.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RecallError {
    /// The frame that the next one is to be matched with is no longer what it was.
    #[error(
        "frame {reference} of the run, with which the next one is to be matched, cannot be read again: {why}"
    )]
    Frame {
        /// Its number, counted over all frames.
        reference: usize,
        /// What is wrong with it.
        why: Unanswered,
    },
    /// Tracks are no images.
    #[error("the run was begun with frames of another kind")]
    Kind,
}

/// Why nothing can be pushed.
fn reason(input: Result<FrameInput, Unanswered>) -> Unanswered {
    input.err().unwrap_or_else(|| Unanswered::BadImage("images and tracks are mixed".into()))
}
