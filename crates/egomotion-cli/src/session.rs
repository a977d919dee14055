//! One sequence through the pipeline: the loop that `run` and `demo` share.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::Result;
use egomotion::geometry::{Grid, Image, RigidMotion, StereoRig, Twist};
use egomotion::pipeline::stereo::StageTimes;
use egomotion::pipeline::{Config, FrameMotion, Observe, StereoMotion, TrackMotion, Trajectory, Unanswered};
use indicatif::{ProgressBar, ProgressStyle};

use crate::feed::{Fetched, Given, with_frames};
use crate::report::{Album, FramePictures};
use crate::terminal::tell;

/// What is to be run.
pub struct Session<'a> {
    pub rig: StereoRig,
    pub config: &'a Config,
    /// Number of frames, as far as it is known.
    pub frames: usize,
    /// Pixels of the left image never to use.
    pub mask: Option<Grid<bool>>,
    /// The same of the right image.
    pub mask_right: Option<Grid<bool>>,
    /// Frames are tracks, not images.
    pub tracks: bool,
    pub progress: ProgressBar,
}

/// One answered or unanswered frame, without its maps.
pub struct Row {
    /// Index of the frame in the source.
    pub index: usize,
    /// That of the earlier frame it was matched with.
    pub reference_index: Option<usize>,
    pub motion: FrameMotion,
    /// True φ over the same interval.
    pub truth: Option<Twist>,
}

/// What a session leaves behind.
pub struct Outcome {
    pub rows: Vec<Row>,
    pub trajectory: Trajectory,
    /// True poses, relative to the first frame; only if every frame has one.
    pub truth: Option<Vec<RigidMotion>>,
    /// Pictures of some frames, for the report.
    pub album: Album,
    pub complete: bool,
    pub stages_ms: Vec<(&'static str, f64)>,
    pub frame_ms: f64,
    pub wall_s: f64,
}

/// Set when the user asks to stop.
pub fn stop_signal() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let handler = Arc::clone(&stop);
    // Only the first session of a process can install it; a second one shares the default.
    let _ = ctrlc::set_handler(move || handler.store(true, Ordering::Relaxed));
    stop
}

/// A progress bar on a terminal, nothing in a pipe.
pub fn progress(frames: usize, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(frames as u64);
    let template = "{msg} {wide_bar} {pos}/{len} frames, {per_sec}, {eta} left";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

impl Session<'_> {
    /// Push every frame that `fetch` has through the pipeline; `look` sees each answer with its maps.
    pub fn run(
        &self,
        stop: &AtomicBool,
        fetch: impl Fn(usize) -> Option<Fetched> + Sync,
        mut look: impl FnMut(&Row) -> Result<()>,
    ) -> Result<Outcome> {
        let mut work = Work::new(self)?;
        with_frames(stop, fetch, |frames| -> Result<()> {
            for fetched in frames {
                work.frame(fetched, &mut look)?;
            }
            Ok(())
        })?;
        self.progress.finish_and_clear();
        Ok(work.outcome(!stop.load(Ordering::Relaxed)))
    }

    /// Say what the user should know of an answer at once.
    fn warn(&self, index: usize, motion: &FrameMotion) {
        let tell = |text: std::fmt::Arguments<'_>| self.progress.suspend(|| tell(text));
        match &motion.motion {
            Err(Unanswered::First) => {}
            Err(why) => tell(format_args!("frame {index}: {why}")),
            Ok(estimate) if !estimate.is_complete() => {
                tell(format_args!("frame {index}: not determined: {}", estimate.undetermined));
            }
            Ok(_) => {}
        }
    }
}

/// A session under way.
struct Work<'a> {
    session: &'a Session<'a>,
    pipeline: Pipeline,
    rows: Vec<Row>,
    trajectory: Trajectory,
    truths: Vec<Option<RigidMotion>>,
    /// The frame that the next one is matched with, and its left image: pictures show the maps over it.
    reference: Option<(usize, Image)>,
    album: Album,
    tally: Tally,
    start: Instant,
}

impl<'a> Work<'a> {
    fn new(session: &'a Session<'a>) -> Result<Self> {
        Ok(Self {
            session,
            pipeline: Pipeline::new(session)?,
            rows: Vec::new(),
            trajectory: Trajectory::new(),
            truths: Vec::new(),
            reference: None,
            album: Album::of(session.frames),
            tally: Tally::default(),
            start: Instant::now(),
        })
    }

    fn frame(&mut self, fetched: Fetched, look: &mut impl FnMut(&Row) -> Result<()>) -> Result<()> {
        let Fetched { index, time_s, frame, truth, decode_ms } = fetched;
        let left = match &frame {
            Ok(Given::Frame(frame)) => Some(frame.left.clone()),
            _ => None,
        };
        let motion = self.pipeline.push(time_s, frame);
        self.session.warn(index, &motion);
        self.tally.add(decode_ms, &motion.stages);
        self.trajectory.push(&motion);
        self.truths.push(truth);
        let reference = motion.reference;
        let before = reference.and_then(|r| *self.truths.get(r)?);
        let row = Row {
            index,
            reference_index: reference.and_then(|r| Some(self.rows.get(r)?.index)),
            truth: before.zip(truth).map(|(before, after)| relative(&before, &after)),
            motion,
        };
        let writing = Instant::now();
        look(&row)?;
        self.picture(&row, left.as_ref());
        self.tally.aside_ms += writing.elapsed().as_secs_f64() * 1e3;
        if self.pipeline.reference() == Some(row.motion.frame)
            && let Some(image) = left
        {
            self.reference = Some((row.motion.frame, image));
        }
        // Maps are large; a long run keeps only its rows.
        self.rows.push(Row { motion: FrameMotion { dense: None, ..row.motion }, ..row });
        self.session.progress.inc(1);
        Ok(())
    }

    /// Pictures of the frame that the maps belong to, or of the left image where there are none.
    fn picture(&mut self, row: &Row, left: Option<&Image>) {
        let motion = &row.motion;
        if self.session.config.observe == Observe::Sparse {
            if let Some(left) = left {
                let width_px = self.album.width_px(left.size());
                self.album.offer(|| FramePictures::of_image(row.index, self.rows.len() + 1, left, width_px));
            }
            return;
        }
        let earlier = self.reference.as_ref().filter(|(frame, _)| Some(*frame) == motion.reference);
        if let (Some(dense), Some((_, image)), Some(dt_s), Some(index)) =
            (&motion.dense, earlier, motion.dt_s, row.reference_index)
        {
            let width_px = self.album.width_px(image.size());
            self.album.offer(|| FramePictures::new(index, self.rows.len(), image, dense, dt_s, width_px));
        }
    }

    fn outcome(self, complete: bool) -> Outcome {
        let wall_ms = self.start.elapsed().as_secs_f64() * 1e3;
        let count = self.rows.len().max(1) as f64;
        let first = self.truths.first().copied().flatten();
        let truth: Option<Vec<RigidMotion>> =
            self.truths.iter().map(|pose| Some(first?.inverse().after(&(*pose)?))).collect();
        Outcome {
            complete: complete || self.rows.len() == self.session.frames,
            rows: self.rows,
            trajectory: self.trajectory,
            truth,
            album: self.album,
            stages_ms: self.tally.means(count),
            frame_ms: (wall_ms - self.tally.aside_ms) / count,
            wall_s: wall_ms / 1e3,
        }
    }
}

/// What turns frames of either kind into motion.
enum Pipeline {
    Images(Box<StereoMotion>),
    Tracks(Box<TrackMotion>),
}

impl Pipeline {
    fn new(session: &Session<'_>) -> Result<Self> {
        let config = session.config.clone();
        if session.tracks {
            return Ok(Self::Tracks(Box::new(TrackMotion::new(session.rig, config)?)));
        }
        let mut images = StereoMotion::new(session.rig, config)?;
        images.set_mask(session.mask.clone());
        images.set_right_mask(session.mask_right.clone());
        Ok(Self::Images(Box::new(images)))
    }

    fn push(&mut self, time_s: f64, given: Result<Given, Unanswered>) -> FrameMotion {
        match (self, given) {
            (Self::Images(images), Ok(Given::Frame(frame))) => images.push(*frame),
            (Self::Tracks(tracks), Ok(Given::Tracks(points))) => tracks.push(time_s, &points),
            (Self::Images(images), given) => images.skip(time_s, reason(given)),
            (Self::Tracks(tracks), given) => tracks.skip(time_s, reason(given)),
        }
    }

    fn reference(&self) -> Option<usize> {
        match self {
            Self::Images(images) => images.reference(),
            Self::Tracks(tracks) => tracks.reference(),
        }
    }
}

/// Why nothing can be pushed.
fn reason(given: Result<Given, Unanswered>) -> Unanswered {
    given.err().unwrap_or_else(|| Unanswered::BadImage("images and tracks are mixed".into()))
}

/// φ of the scene between two true camera poses.
fn relative(before: &RigidMotion, after: &RigidMotion) -> Twist {
    after.inverse().after(before).log()
}

/// Milliseconds by stage, summed over frames.
#[derive(Default)]
struct Tally {
    decode_ms: f64,
    stages: StageTimes,
    /// Spent on writing and pictures, which is not the pipeline's.
    aside_ms: f64,
}

impl Tally {
    fn add(&mut self, decode_ms: f64, stages: &StageTimes) {
        self.decode_ms += decode_ms;
        self.stages.pyramids_ms += stages.pyramids_ms;
        self.stages.disparity_ms += stages.disparity_ms;
        self.stages.tracks_ms += stages.tracks_ms;
        self.stages.flow_ms += stages.flow_ms;
        self.stages.estimate_ms += stages.estimate_ms;
        self.stages.maps_ms += stages.maps_ms;
    }

    fn means(&self, count: f64) -> Vec<(&'static str, f64)> {
        let s = &self.stages;
        [
            ("decode", self.decode_ms),
            ("pyramids", s.pyramids_ms),
            ("disparity", s.disparity_ms),
            ("tracks", s.tracks_ms),
            ("flow", s.flow_ms),
            ("estimate", s.estimate_ms),
            ("maps", s.maps_ms),
        ]
        .map(|(name, total)| (name, total / count))
        .to_vec()
    }
}
