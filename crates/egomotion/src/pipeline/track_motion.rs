//! Tracks that others made, frame by frame, to motion.

use std::collections::HashMap;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::answer::{FrameMotion, PairAnswer, Unanswered};
use super::config::{Config, ConfigError, Method, Observe, PipelineError};
use super::interpret;
use super::memory::{Earlier, Memory, TimedFrame};
use super::plan::Interval;
use super::solve::{Observed, contradiction, first_motion, refined_motion, solve, whole_motion};
use super::stages::{StageTimes, timed};
use crate::estimate::{LastMotion, TrackSource};
use crate::geometry::median;
use crate::geometry::{Gaussian, StereoRig};
use crate::observe::StereoTrack;

/// Standard deviation of a tracked place until the residuals tell a better one, in pixels.
const PLACE_SIGMA_PX: f64 = 0.5;

/// A point of a track: where one frame's two images show it, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackPoint {
    /// The same number for the same point in every frame.
    pub track: u64,
    /// (u, v) in the left image.
    pub left: (f64, f64),
    /// (u, v) in the right image.
    pub right: (f64, f64),
}

impl TrackPoint {
    fn is_finite(&self) -> bool {
        [self.left.0, self.left.1, self.right.0, self.right.1].iter().all(|c| c.is_finite())
    }
}

/// Turns tracks into motion: the estimation of [`super::StereoMotion`] without its images.
///
/// How exact the tracks are is found from their residuals. A point at exactly the places that the reference frame has
/// for its track is a copy and no measurement: it is left out, and a frame of copies alone (or of copies and of
/// tracks that have only begun) is no new frame ([`Unanswered::RepeatedFrame`]).
#[derive(Debug)]
pub struct TrackMotion {
    rig: StereoRig,
    config: Config,
    memory: Memory<TrackedFrame>,
}

/// The points of one time.
#[derive(Debug)]
struct TrackedFrame {
    frame: usize,
    time_s: f64,
    points: HashMap<u64, TrackPoint>,
}

impl TimedFrame for TrackedFrame {
    fn moment(&self) -> (usize, f64) {
        (self.frame, self.time_s)
    }
}

/// What is kept of a frame of tracks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptTracks {
    frame: usize,
    time_s: f64,
    points: Vec<TrackPoint>,
}

/// The memory of a [`TrackMotion`].
pub type TrackMemory = Memory<KeptTracks>;

impl TrackMotion {
    /// A pipeline for one rig; [`Config::observe`] has no meaning here.
    ///
    /// # Errors
    /// [`PipelineError`] when the rig cannot measure or the choices do not fit together.
    pub fn new(rig: StereoRig, config: Config) -> Result<Self, PipelineError> {
        rig.check()?;
        config.check()?;
        if config.method == Method::Dcce {
            return Err(ConfigError::SparseDepthChange.into());
        }
        let config = Config { observe: Observe::Sparse, ..config };
        Ok(Self { rig, config, memory: Memory::new() })
    }

    /// The frame that the next one will be compared with.
    pub fn reference(&self) -> Option<usize> {
        self.memory.reference().map(|reference| reference.frame)
    }

    /// What is kept of the frames so far: with it [`TrackMotion::recall`] goes on.
    pub fn memory(&self) -> TrackMemory {
        self.memory.kept(|reference| KeptTracks {
            frame: reference.frame,
            time_s: reference.time_s,
            points: reference.points.values().copied().collect(),
        })
    }

    /// Go on where a pipeline of the same rig and choices had this memory: every later answer is the same.
    pub fn recall(&mut self, memory: TrackMemory) {
        self.memory = memory.map(|KeptTracks { frame, time_s, points }| {
            let points = points.into_iter().map(|point| (point.track, point)).collect();
            TrackedFrame { frame, time_s, points }
        });
    }

    /// Account for a frame that could not be read.
    pub fn skip(&mut self, time_s: f64, why: Unanswered) -> FrameMotion {
        self.memory.skip(time_s, why)
    }

    /// The motion from the last good frame to this one, from the tracks that both have.
    pub fn push(&mut self, time_s: f64, points: &[TrackPoint]) -> FrameMotion {
        if let Err(why) = self.memory.check_time(time_s) {
            return self.skip(time_s, why);
        }
        self.memory.set_time(time_s);
        let points = points.iter().filter(|p| p.is_finite()).map(|point| (point.track, *point)).collect();
        let mut here = TrackedFrame { frame: self.memory.next_frame(), time_s, points };
        let Some(earlier) = self.memory.take_earlier() else {
            let first = self.skip(time_s, Unanswered::First);
            self.memory.set_earlier(Earlier::only(here));
            return first;
        };
        let mut copies = false;
        for before in earlier.iter() {
            copies |= here.forget_copies(before);
        }
        if copies {
            let (reference, time_s) = (earlier.reference.moment(), here.time_s);
            // New tracks tell of a time that the old ones do not reach: the motion up to it is lost.
            self.memory.set_earlier(if here.points.is_empty() { earlier } else { Earlier::only(here) });
            return self.memory.count_unanswered(time_s, Some(reference), Unanswered::RepeatedFrame);
        }
        self.answer(earlier, here)
    }

    /// The answer of a frame and those before, and what the next one needs of them.
    fn answer(&mut self, earlier: Earlier<TrackedFrame>, here: TrackedFrame) -> FrameMotion {
        let (mut answer, mut last) = self.compare(&earlier.reference, &here);
        if answer.motion.is_err()
            && let Some(newest) = &earlier.newest
        {
            let other = self.compare(newest, &here);
            if other.0.motion.is_ok() {
                (answer, last) = other;
            }
        }
        self.memory.remember(&answer, last, earlier, here);
        answer
    }

    /// The motion between two frames, and what the next pair needs of it.
    fn compare(&self, before: &TrackedFrame, after: &TrackedFrame) -> (FrameMotion, Option<LastMotion>) {
        let mut stages = StageTimes::default();
        let dt_s = after.time_s - before.time_s;
        let expected = self.memory.expected_motion(dt_s);
        let pairs = before.pairs(after);
        let tracks: Vec<StereoTrack> = pairs
            .iter()
            .map(|(a, b)| {
                let mut track = StereoTrack { before: self.located(a), after: self.located(b) };
                track.correct(&self.config.rig_errors.values(), &self.rig);
                track
            })
            .filter(|track| track.before.mean.z > 0.0 && track.after.mean.z > 0.0)
            .collect();
        let mut rows: Vec<f64> = pairs.iter().map(|(a, _)| a.right.1 - a.left.1).collect();
        let rows = Some(median(&mut rows).abs()).filter(|rows| rows.is_finite());
        let interval = Interval::new(&self.rig, &self.config, TrackSource::Stereo, dt_s);
        let start = first_motion(&tracks, &interval, expected.as_ref());
        let observed = Observed::Tracks(&tracks);
        let solved = timed(&mut stages.estimate_ms, || solve(&observed, &interval, Some(&start?)));
        let linear = solved.as_ref().ok().filter(|_| interval.plan.equations.are_linear());
        let contradiction = linear.zip(start.ok()).and_then(|(motion, start)| {
            contradiction(
                &motion.motion,
                &refined_motion(&tracks, &interval, &start).ok()?,
                &observed,
                &interval,
            )
        });
        let shared = self.memory.shared();
        let rig_sigma = shared.rig_sigma(rows, &self.config, &self.rig);
        let last = shared.last_until(before.frame);
        let (motion, last) = match solved {
            Ok(solved) => {
                let (motion, last) = whole_motion(solved, &tracks, &interval, &rig_sigma, last);
                (Ok(motion), last)
            }
            Err(why) => (Err(Unanswered::from(why)), None),
        };
        let obstacle = interpret::tracks(&tracks, motion.as_ref().ok(), &interval);
        let moving = Vec::new();
        let answer = PairAnswer {
            motion,
            last: None,
            rig_sigma,
            row_disagreement_px: rows,
            contradiction,
            obstacle,
            moving,
        };
        (FrameMotion::of_pair(before.moment(), after.moment(), answer, None, stages), last)
    }

    /// (x, y, d): v is the mean of both images', and u is that of the left one.
    fn located(&self, point: &TrackPoint) -> Gaussian<3> {
        let v = 0.5 * (point.left.1 + point.right.1);
        let (x, y) = self.rig.image_from_pixel(point.left.0, v);
        let d = self.rig.disparity_from_shift(point.left.0 - point.right.0);
        let (variance, aspect) = (PLACE_SIGMA_PX * PLACE_SIGMA_PX, self.rig.aspect());
        // d = u_left − u_right shares the left one's error.
        let cov = Matrix3::new(
            variance,
            0.0,
            variance, //
            0.0,
            0.5 * variance * aspect * aspect,
            0.0, //
            variance,
            0.0,
            2.0 * variance,
        );
        Gaussian { mean: Vector3::new(x, y, d), cov }
    }
}

impl TrackedFrame {
    /// Leave out the points that are copies of an earlier frame's; whether no shared track is left by that.
    fn forget_copies(&mut self, before: &Self) -> bool {
        let shared =
            |here: &Self| here.points.keys().filter(|track| before.points.contains_key(track)).count();
        let all = shared(self);
        self.points.retain(|track, point| before.points.get(track) != Some(point));
        all > 0 && shared(self) == 0
    }

    /// The points of the tracks that a later frame has too, in the order of the tracks' numbers: that of a hash map is
    /// not the same twice.
    fn pairs<'a>(&'a self, after: &'a Self) -> Vec<(&'a TrackPoint, &'a TrackPoint)> {
        let shared = |(track, point)| Some((point, after.points.get(track)?));
        let mut pairs: Vec<(&TrackPoint, &TrackPoint)> = self.points.iter().filter_map(shared).collect();
        pairs.sort_by_key(|(point, _)| point.track);
        pairs
    }
}
