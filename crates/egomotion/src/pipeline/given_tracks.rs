//! Tracks that others made, frame by frame, to motion.

use std::collections::HashMap;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::config::{Config, ConfigError, Method, Observe};
use super::memory::TrackMemory;
use super::stereo::{FrameMotion, MOST_FAILURES, PipelineError, StageTimes};
use super::track_solver::TrackSolver;
use super::unanswered::Unanswered;
use crate::estimate::TrackSource;
use crate::geometry::{Gaussian, StereoRig, Twist, median};
use crate::observe::StereoTrack;

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

/// Standard deviation of a given place until its residuals tell, in pixels.
const PLACE_SIGMA_PX: f64 = 0.5;
/// Of fewer tracks the distribution of their residuals cannot be told: then Student's t is taken as it stands.
const FEWEST_FITTED: usize = 200;

/// Turns tracks into motion: the estimation of [`super::StereoMotion`] without its images.
///
/// How exact the tracks are is found from their residuals. A point at exactly the places that the reference frame has
/// for its track is a copy and no measurement: it is left out, and a frame of copies alone (or of copies and of
/// tracks that have only begun) is no new frame ([`Unanswered::RepeatedFrame`]).
#[derive(Debug)]
pub struct TrackMotion {
    rig: StereoRig,
    config: Config,
    frames: usize,
    last_time_s: Option<f64>,
    reference: Option<Reference>,
    /// Velocity per second from the last answer.
    velocity: Option<Twist>,
    failures: usize,
}

#[derive(Debug)]
struct Reference {
    frame: usize,
    time_s: f64,
    points: HashMap<u64, TrackPoint>,
}

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
        Ok(Self { rig, config, frames: 0, last_time_s: None, reference: None, velocity: None, failures: 0 })
    }

    /// The frame that the next one will be compared with.
    pub fn reference(&self) -> Option<usize> {
        self.reference.as_ref().map(|reference| reference.frame)
    }

    /// What is kept of the frames so far: with it [`TrackMotion::recall`] goes on.
    pub fn memory(&self) -> TrackMemory {
        let kept = |r: &Reference| (r.frame, r.time_s, r.points.values().copied().collect());
        TrackMemory {
            frames: self.frames,
            last_time_s: self.last_time_s,
            reference: self.reference.as_ref().map(kept),
            velocity: self.velocity,
            failures: self.failures,
        }
    }

    /// Go on where a pipeline of the same rig and choices had this memory: every later answer is the same.
    pub fn recall(&mut self, memory: TrackMemory) {
        let TrackMemory { frames, last_time_s, reference, velocity, failures } = memory;
        let again = |(frame, time_s, points): (usize, f64, Vec<TrackPoint>)| {
            let points = points.into_iter().map(|point| (point.track, point)).collect();
            Reference { frame, time_s, points }
        };
        self.reference = reference.map(again);
        (self.frames, self.last_time_s) = (frames, last_time_s);
        (self.velocity, self.failures) = (velocity, failures);
    }

    /// Account for a frame that could not be read.
    pub fn skip(&mut self, time_s: f64, why: Unanswered) -> FrameMotion {
        let frame = self.frames;
        self.frames += 1;
        let reference = self.reference.as_ref().map(|r| (r.frame, r.time_s));
        FrameMotion::unanswered((frame, time_s), reference, why)
    }

    /// The motion from the last good frame to this one, from the tracks that both have.
    pub fn push(&mut self, time_s: f64, points: &[TrackPoint]) -> FrameMotion {
        if !time_s.is_finite() || self.last_time_s.is_some_and(|last| time_s <= last) {
            return self.skip(time_s, Unanswered::BadTime);
        }
        self.last_time_s = Some(time_s);
        let finite =
            |p: &&TrackPoint| [p.left.0, p.left.1, p.right.0, p.right.1].iter().all(|c| c.is_finite());
        let mut points: HashMap<u64, TrackPoint> =
            points.iter().filter(finite).map(|point| (point.track, *point)).collect();
        let Some(before) = self.reference.take() else {
            let first = self.skip(time_s, Unanswered::First);
            self.reference = Some(Reference { frame: first.frame, time_s, points });
            return first;
        };
        let shared = points.keys().filter(|track| before.points.contains_key(track)).count();
        points.retain(|track, point| before.points.get(track) != Some(point));
        let fresh = points.keys().filter(|track| before.points.contains_key(track)).count();
        if shared > 0 && fresh == 0 {
            // New tracks tell of a time that the old ones do not reach: the motion up to it is lost.
            let frame = self.frames;
            self.frames += 1;
            let reference = Some((before.frame, before.time_s));
            self.reference = Some(match points.is_empty() {
                true => before,
                false => Reference { frame, time_s, points },
            });
            return FrameMotion::unanswered((frame, time_s), reference, Unanswered::RepeatedFrame);
        }
        self.compare(before, Reference { frame: self.frames, time_s, points })
    }

    fn compare(&mut self, before: Reference, after: Reference) -> FrameMotion {
        let mut stages = StageTimes::default();
        let dt_s = after.time_s - before.time_s;
        let prior = self.velocity.map(|velocity| velocity.scaled(dt_s));
        let mut pairs: Vec<(&TrackPoint, &TrackPoint)> = before
            .points
            .iter()
            .filter_map(|(track, point)| Some((point, after.points.get(track)?)))
            .collect();
        // The order of a hash map is not the same twice.
        pairs.sort_by_key(|(point, _)| point.track);
        let tracks: Vec<StereoTrack> = pairs
            .iter()
            .map(|(a, b)| StereoTrack { before: self.measured(a), after: self.measured(b) })
            .filter(|track| track.before.mean.z > 0.0 && track.after.mean.z > 0.0)
            .collect();
        let mut rows: Vec<f64> = pairs.iter().map(|(a, _)| a.right.1 - a.left.1).collect();
        let rows = Some(median(&mut rows).abs()).filter(|rows| rows.is_finite());
        let mut config = self.config.clone();
        config.maximum_likelihood.kernel.fitted &= tracks.len() >= FEWEST_FITTED;
        let solver = TrackSolver { rig: &self.rig, config: &config, dt_s, source: TrackSource::Stereo };
        let rough = solver.rough(&tracks, prior.as_ref());
        let result = solver.sparse(&tracks, rough, rows, &mut stages);
        let answer = FrameMotion {
            frame: after.frame,
            reference: Some(before.frame),
            time_s: after.time_s,
            dt_s: Some(dt_s),
            motion: result.motion,
            row_disagreement_px: rows,
            obstacle: result.obstacle,
            moving: Vec::new(),
            dense: None,
            stages,
        };
        self.frames += 1;
        self.failures = if answer.motion.is_ok() { 0 } else { self.failures + 1 };
        self.velocity = match &answer.motion {
            Ok(motion) if motion.is_complete() => Some(motion.phi().scaled(1.0 / dt_s)),
            _ => None,
        };
        let keep_old = answer.motion.is_err() && self.failures < MOST_FAILURES;
        self.reference = Some(if keep_old { before } else { after });
        answer
    }

    /// (x, y, d): v is the mean of both images', and u is that of the left one.
    fn measured(&self, point: &TrackPoint) -> Gaussian<3> {
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
