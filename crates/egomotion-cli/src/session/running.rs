//! A session under way: what it has done, frame by frame.

use std::time::Instant;

use anyhow::{Result, anyhow};
use egomotion::geometry::{Image, RigidMotion, Twist};
use egomotion::pipeline::{FrameMotion, Observe, Trajectory};
use egomotion_io::recording::{FrameInput, Pipeline, SourceFrame};
use egomotion_report::run::{Album, FramePictures};

use super::Session;
use super::frame_result::FrameResult;
use super::outcome::Outcome;
use super::run_log::{AlbumOffer, DoneFrame, RunLog};
use super::stage_times::StageSums;
use crate::journal::START_ANEW;

/// A session under way.
pub struct RunningSession<'a> {
    session: &'a Session<'a>,
    pipeline: Pipeline,
    frames: Vec<FrameResult>,
    trajectory: Trajectory,
    truths: Vec<Option<RigidMotion>>,
    /// The frame that the next one is matched with, and its left image: pictures show the maps over it.
    reference: Option<(usize, Image)>,
    album: Album,
    times: StageSums,
    log: Option<RunLog>,
    start: Instant,
    /// Spent before this process went on.
    earlier_ms: f64,
}

impl<'a> RunningSession<'a> {
    pub fn new(session: &'a Session<'a>) -> Result<Self> {
        Ok(Self {
            session,
            pipeline: Pipeline::new(
                session.rig,
                session.config.clone(),
                session.tracks,
                session.masks.clone(),
            )?,
            frames: Vec::new(),
            trajectory: Trajectory::new(),
            truths: Vec::new(),
            reference: None,
            album: Album::of(session.frames),
            times: StageSums::default(),
            log: None,
            start: Instant::now(),
            earlier_ms: 0.0,
        })
    }

    /// Number of frames that are done.
    pub fn done(&self) -> usize {
        self.frames.len()
    }

    /// Take over what a log holds, and add to it from here on.
    pub fn recall(&mut self, mut log: RunLog, fetch: &impl Fn(usize) -> Option<SourceFrame>) -> Result<()> {
        let past = log.take_past();
        if let Some(last) = past.last() {
            (self.earlier_ms, self.times.aside_ms) = (last.wall_ms, last.aside_ms);
            let recalled = self.pipeline.recall(last.memory.clone(), fetch);
            let left = recalled.map_err(|why| anyhow!("{why}; {START_ANEW}"))?;
            self.reference = self.pipeline.reference().zip(left);
        }
        for DoneFrame { row, pose, decode_ms, picture, .. } in past.into_iter().flat_map(|s| s.frames) {
            self.times.add(decode_ms, &row.motion.stages);
            self.trajectory.push(&row.motion);
            self.truths.push(pose);
            if let AlbumOffer::Offered(made) = picture {
                self.album.recall(made.map(|made| *made));
            }
            self.frames.push(row);
        }
        self.session.progress.set_position(self.frames.len() as u64);
        self.session.progress.reset_eta();
        self.log = Some(log);
        Ok(())
    }

    /// Take the next frame; `look` sees its answer with its maps.
    pub fn frame(
        &mut self,
        fetched: SourceFrame,
        look: &mut impl FnMut(&FrameResult) -> Result<()>,
    ) -> Result<()> {
        let SourceFrame { index, time_s, input: frame, truth, decode_ms, bytes } = fetched;
        let left = match &frame {
            Ok(FrameInput::Images(frame)) => Some(frame.left.clone()),
            _ => None,
        };
        let motion = self.pipeline.push(time_s, frame);
        self.session.warn(index, &motion);
        self.times.add(decode_ms, &motion.stages);
        self.trajectory.push(&motion);
        self.truths.push(truth);
        let reference = motion.reference;
        let before = reference.and_then(|r| *self.truths.get(r)?);
        let row = FrameResult {
            index,
            reference_index: reference.and_then(|r| Some(self.frames.get(r)?.index)),
            truth: before.zip(truth).map(|(before, after)| relative(&before, &after)),
            motion,
        };
        let writing = Instant::now();
        look(&row)?;
        let picture = self.picture(&row, left.as_ref());
        if self.pipeline.reference() == Some(row.motion.frame)
            && let Some(image) = left
        {
            self.reference = Some((row.motion.frame, image));
        }
        // Maps are large; a long run keeps only its rows.
        let row = FrameResult { motion: FrameMotion { dense: None, ..row.motion }, ..row };
        if let Some(log) = &mut self.log {
            log.add(DoneFrame { row: row.clone(), pose: truth, decode_ms, bytes, picture });
        }
        self.frames.push(row);
        if self.log.as_ref().is_some_and(|log| log.is_due(self.wall_ms())) {
            self.keep()?;
        }
        self.times.aside_ms += writing.elapsed().as_secs_f64() * 1e3;
        self.session.progress.inc(1);
        Ok(())
    }

    /// Pictures of the frame that the maps belong to, or of the left image where there are none.
    fn picture(&mut self, row: &FrameResult, left: Option<&Image>) -> AlbumOffer {
        let motion = &row.motion;
        let next = self.frames.len() + 1;
        if self.session.config.observe == Observe::Sparse {
            let Some(left) = left else { return AlbumOffer::None };
            let width_px = self.album.width_px(left.size());
            return AlbumOffer::of(
                self.album.offer(|| FramePictures::of_image(row.index, next, left, width_px)),
            );
        }
        let earlier = self.reference.as_ref().filter(|(frame, _)| Some(*frame) == motion.reference);
        let (Some(dense), Some((_, image)), Some(dt_s), Some(index)) =
            (&motion.dense, earlier, motion.dt_s, row.reference_index)
        else {
            return AlbumOffer::None;
        };
        let width_px = self.album.width_px(image.size());
        AlbumOffer::of(self.album.offer(|| FramePictures::new(index, next - 1, image, dense, dt_s, width_px)))
    }

    /// Write what is done to the log, if there is one.
    pub fn keep(&mut self) -> Result<()> {
        let (wall_ms, aside_ms) = (self.wall_ms(), self.times.aside_ms);
        match &mut self.log {
            Some(log) => log.keep(self.pipeline.memory(), wall_ms, aside_ms),
            None => Ok(()),
        }
    }

    fn wall_ms(&self) -> f64 {
        self.earlier_ms + self.start.elapsed().as_secs_f64() * 1e3
    }

    /// What is left when no frame is to come any more.
    pub fn outcome(self, complete: bool) -> Outcome {
        let wall_ms = self.wall_ms();
        let count = self.frames.len().max(1) as f64;
        let first = self.truths.first().copied().flatten();
        let truth: Option<Vec<RigidMotion>> =
            self.truths.iter().map(|pose| Some(first?.inverse().after(&(*pose)?))).collect();
        Outcome {
            complete: complete || self.frames.len() == self.session.frames,
            frames: self.frames,
            trajectory: self.trajectory,
            truth,
            album: self.album,
            stages_ms: self.times.means(count),
            frame_ms: (wall_ms - self.times.aside_ms) / count,
            wall_s: wall_ms / 1e3,
            log: self.log,
        }
    }
}

/// φ of the scene between two true camera poses.
fn relative(before: &RigidMotion, after: &RigidMotion) -> Twist {
    after.inverse().after(before).log()
}
