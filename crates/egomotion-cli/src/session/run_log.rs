//! What is done of a run, on the disk as it goes on, so that a stopped or killed run can go on from there.
//!
//! A journal whose parts are stretches of frames, each ending with what the pipeline then kept. A stretch is a
//! tenth of the run so far, and no longer than [`MAX_STRETCH_MS`]: that much work is lost at most.

use anyhow::Result;
use egomotion::geometry::RigidMotion;
use egomotion_io::recording::Memory;
use egomotion_report::run::FramePictures;
use serde::{Deserialize, Serialize};

use super::frame_result::FrameResult;
use crate::journal::{Journal, Parts};

/// Longest time between two writes, in milliseconds: a kill loses no more work than that.
const MAX_STRETCH_MS: f64 = 1e4;
/// Share of the run so far after which it is written again. With a larger one a kill loses more work; with a smaller one
/// the journal grows, because every stretch carries what the pipeline keeps.
const STRETCH_SHARE: f64 = 0.1;

/// Frames that were done without a break in between.
#[derive(Debug, Serialize, Deserialize)]
pub struct Stretch {
    pub frames: Vec<DoneFrame>,
    /// What the pipeline kept after them.
    pub(super) memory: Memory,
    /// Spent since the run was begun, in milliseconds, and how much of it on writing.
    pub(super) wall_ms: f64,
    pub(super) aside_ms: f64,
}

/// One frame that is done.
#[derive(Debug, Serialize, Deserialize)]
pub struct DoneFrame {
    pub row: FrameResult,
    /// True pose world_from_camera.
    pub pose: Option<RigidMotion>,
    /// Size of its files: a recording that was changed since is noticed by it.
    pub bytes: u64,
    pub(super) decode_ms: f64,
    pub(super) picture: AlbumOffer,
}

/// What a frame gave to the report's album.
#[derive(Debug, Serialize, Deserialize)]
pub enum AlbumOffer {
    /// It had nothing to show.
    None,
    /// With the pictures, if it was their turn.
    Offered(Option<Box<FramePictures>>),
}

impl AlbumOffer {
    /// What an album made of the pictures that it was offered.
    pub fn of(made: Option<FramePictures>) -> Self {
        Self::Offered(made.map(Box::new))
    }
}

/// The journal of a run.
#[derive(Debug)]
pub struct RunLog {
    journal: Journal,
    past: Vec<Stretch>,
    /// Frames in the journal.
    kept: usize,
    kept_at_ms: f64,
    pending: Vec<DoneFrame>,
}

impl RunLog {
    /// Go on with a journal after the parts that it holds.
    pub fn new(journal: Journal, parts: Parts<Stretch>) -> Self {
        let past: Vec<Stretch> = parts.into_values().flatten().collect();
        let kept = past.iter().map(|stretch| stretch.frames.len()).sum();
        let kept_at_ms = past.last().map_or(0.0, |last| last.wall_ms);
        Self { journal, past, kept, kept_at_ms, pending: Vec::new() }
    }

    /// The frames that earlier runs did.
    pub fn past(&self) -> impl Iterator<Item = &DoneFrame> {
        self.past.iter().flat_map(|stretch| &stretch.frames)
    }

    pub(super) fn take_past(&mut self) -> Vec<Stretch> {
        std::mem::take(&mut self.past)
    }

    /// One frame more, to be written with the next ones.
    pub(super) fn add(&mut self, frame: DoneFrame) {
        self.pending.push(frame);
    }

    /// Whether it is time to write.
    pub(super) fn is_due(&self, wall_ms: f64) -> bool {
        wall_ms - self.kept_at_ms >= (STRETCH_SHARE * wall_ms).min(MAX_STRETCH_MS)
    }

    /// Write what was added, with what the pipeline keeps of it.
    pub(super) fn keep(&mut self, memory: Memory, wall_ms: f64, aside_ms: f64) -> Result<()> {
        if self.pending.is_empty() {
            return Ok(());
        }
        let frames = std::mem::take(&mut self.pending);
        let (first, count) = (self.kept, frames.len());
        // Parts come back in the order of their names.
        self.journal.add(&format!("{first:09}"), &[Stretch { frames, memory, wall_ms, aside_ms }])?;
        (self.kept, self.kept_at_ms) = (first + count, wall_ms);
        Ok(())
    }

    /// The run is complete and its results are written.
    pub fn remove(self) -> Result<()> {
        self.journal.remove()
    }
}
