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
use crate::results::ResultFolder;
use crate::terminal::tell;

/// What is to be run.
pub struct Session<'a> {
    pub rig: StereoRig,
    pub config: &'a Config,
    /// Number of frames.
    pub frames: usize,
    /// Pixels never to use.
    pub mask: Option<Grid<bool>>,
    /// Frames are tracks, not images.
    pub tracks: bool,
    /// Write the maps of every frame.
    pub maps: bool,
    pub progress: ProgressBar,
}

/// One answered or unanswered frame, without its maps.
pub struct Row {
    /// Index of the frame in the source.
    pub index: usize,
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
    /// Push every frame through the pipeline; `look` sees each answer with its maps.
    pub fn run(
        &self,
        stop: &AtomicBool,
        out: &ResultFolder,
        fetch: impl Fn(usize) -> Fetched + Sync,
        mut look: impl FnMut(&Row) -> Result<()>,
    ) -> Result<Outcome> {
        let mut pipeline = Pipeline::new(self)?;
        let start = Instant::now();
        let mut tally = Tally::default();
        let mut rows: Vec<Row> = Vec::new();
        let mut trajectory = Trajectory::new();
        let mut truths: Vec<Option<RigidMotion>> = Vec::new();
        let mut reference_image: Option<(usize, Image)> = None;
        let mut album = Album::default();
        with_frames(self.frames, stop, fetch, |frames| -> Result<()> {
            for fetched in frames {
                let Fetched { index, time_s, frame, truth, decode_ms } = fetched;
                truths.push(truth);
                // Pictures show the maps over the image that they belong to.
                let dense = self.config.observe == Observe::Dense;
                let keep = match &frame {
                    Ok(Given::Frame(frame)) if dense => Some(frame.left.clone()),
                    _ => None,
                };
                let motion = pipeline.push(time_s, frame);
                if let Err(why) = &motion.motion
                    && *why != Unanswered::First
                {
                    self.progress.suspend(|| tell(format_args!("frame {index}: {why}")));
                }
                if let Ok(estimate) = &motion.motion
                    && !estimate.is_complete()
                {
                    let free = &estimate.undetermined;
                    self.progress.suspend(|| tell(format_args!("frame {index}: not determined: {free}")));
                }
                tally.add(decode_ms, &motion.stages);
                trajectory.push(&motion);
                let frame = motion.frame;
                let reference = motion.reference;
                let true_motion = reference.and_then(|r| truths[r]).zip(truth).map(|(a, b)| relative(&a, &b));
                let mut row = Row { index, motion, truth: true_motion };
                let writing = Instant::now();
                let earlier = reference_image.as_ref().filter(|(f, _)| Some(*f) == reference);
                look(&row)?;
                if let (Some(dense), Some((r, image))) = (&row.motion.dense, earlier) {
                    let index = rows.get(*r).map_or(*r, |row| row.index);
                    album.offer(|| FramePictures::new(index, image, dense));
                    if self.maps {
                        out.write_maps(index, dense)?;
                    }
                }
                tally.aside_ms += writing.elapsed().as_secs_f64() * 1e3;
                // Maps are large; a long run keeps only its rows.
                row.motion.dense = None;
                if pipeline.reference() == Some(frame)
                    && let Some(image) = keep
                {
                    reference_image = Some((frame, image));
                }
                rows.push(row);
                self.progress.inc(1);
            }
            Ok(())
        })?;
        self.progress.finish_and_clear();
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let count = rows.len().max(1) as f64;
        let first = truths.first().copied().flatten();
        let truth: Option<Vec<RigidMotion>> =
            truths.iter().map(|pose| Some(first?.inverse().after(&(*pose)?))).collect();
        Ok(Outcome {
            complete: rows.len() == self.frames,
            rows,
            trajectory,
            truth,
            album,
            stages_ms: tally.means(count),
            frame_ms: (wall_ms - tally.aside_ms) / count,
            wall_s: wall_ms / 1e3,
        })
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
