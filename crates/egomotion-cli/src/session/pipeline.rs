//! What turns frames into motion: images or tracks.

use anyhow::{Result, anyhow};
use egomotion::geometry::Image;
use egomotion::pipeline::{FrameMotion, StereoMemory, StereoMotion, TrackMemory, TrackMotion, Unanswered};
use serde::{Deserialize, Serialize};

use super::Session;
use crate::feed::{Fetched, Given};
use crate::journal::ANEW;

/// What turns frames of either kind into motion.
pub enum Pipeline {
    Images(Box<StereoMotion>),
    Tracks(Box<TrackMotion>),
}

impl Pipeline {
    pub fn new(session: &Session<'_>) -> Result<Self> {
        let config = session.config.clone();
        if session.tracks {
            return Ok(Self::Tracks(Box::new(TrackMotion::new(session.rig, config)?)));
        }
        let mut images = StereoMotion::new(session.rig, config)?;
        images.set_mask(session.mask.clone());
        images.set_right_mask(session.mask_right.clone());
        Ok(Self::Images(Box::new(images)))
    }

    pub fn push(&mut self, time_s: f64, given: Result<Given, Unanswered>) -> FrameMotion {
        match (self, given) {
            (Self::Images(images), Ok(Given::Frame(frame))) => images.push(*frame),
            (Self::Tracks(tracks), Ok(Given::Tracks(points))) => tracks.push(time_s, &points),
            (Self::Images(images), given) => images.skip(time_s, reason(given)),
            (Self::Tracks(tracks), given) => tracks.skip(time_s, reason(given)),
        }
    }

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
    Images(StereoMemory),
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

    /// Go on from a memory; the reference frame is fetched again, and its left image given back.
    pub fn recall(
        &mut self,
        memory: Memory,
        fetch: impl FnOnce(usize) -> Option<Fetched>,
    ) -> Result<Option<Image>> {
        match (self, memory) {
            (Self::Images(images), Memory::Images(memory)) => {
                let mut left = None;
                let reference = memory.reference().unwrap_or_default();
                let again = |k| match fetch(k).map(|fetched| fetched.frame) {
                    Some(Ok(Given::Frame(frame))) => {
                        left = Some(frame.left.clone());
                        Ok(*frame)
                    }
                    Some(given) => Err(reason(given)),
                    None => Err(Unanswered::BadImage("it is no longer there".into())),
                };
                images.recall(memory, again).map_err(|why| {
                    anyhow!("frame {reference} of the run, with which the next one is to be matched, cannot be read again: {why}; {ANEW}")
                })?;
                Ok(left)
            }
            (Self::Tracks(tracks), Memory::Tracks(memory)) => {
                tracks.recall(memory);
                Ok(None)
            }
            _ => Err(anyhow!("the run was begun with frames of another kind; {ANEW}")),
        }
    }
}

/// Why nothing can be pushed.
fn reason(given: Result<Given, Unanswered>) -> Unanswered {
    given.err().unwrap_or_else(|| Unanswered::BadImage("images and tracks are mixed".into()))
}
