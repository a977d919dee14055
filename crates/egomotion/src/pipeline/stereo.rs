//! Stereo frames in, motion out: the paper's list of sections as one function.

use std::time::Instant;

use thiserror::Error;

use super::config::{Approach, Config, ConfigError, Method, Observe};
use super::maps::{MotionMaps, motion_maps, track_neighbourhoods};
use super::solve::{Observed, solve};
use crate::estimate::maximum_likelihood::{MaximumLikelihoodOptions, maximum_likelihood, robust_start};
use crate::estimate::systematic::common_errors;
use crate::estimate::{MotionEstimate, Unsolvable};
use crate::geometry::{Field, Grid, Image, RigError, RigidMotion, StereoRig, Twist};
use crate::motion::TimeToImpact;
use crate::motion::depth_velocity::{DisparityOffset, RigidPrediction};
use crate::motion::impact::nearest;
use crate::observe::row_disagreement::row_disagreement;
use crate::observe::tracks::{Hints, stereo_tracks};
use crate::observe::{
    DensePair, DisparityMap, DisparityMatcher, FlowField, Pyramid, StereoPyramid, StereoTrack, dense_flow,
};

/// A rectified pair of images of one time.
#[derive(Debug, Clone, PartialEq)]
pub struct StereoFrame {
    /// Time in seconds; it must increase from frame to frame.
    pub time_s: f64,
    /// Left image, of the rig's size.
    pub left: Image,
    /// Right image, of the rig's size.
    pub right: Image,
}

/// Why there is no answer for a frame.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Unanswered {
    /// There is no earlier frame to compare with.
    #[error("no earlier frame")]
    First,
    /// The images cannot be used.
    #[error("{0}")]
    BadImage(String),
    /// The right image is missing.
    #[error("the right image is missing")]
    MissingRight,
    /// The time stamp does not lie after that of the frame before.
    #[error("the time stamp does not increase")]
    BadTime,
    /// The images gave no solvable equations.
    #[error(transparent)]
    Unsolvable(#[from] Unsolvable),
}

impl Unanswered {
    /// One word for tables.
    pub fn code(&self) -> &'static str {
        match self {
            Self::First => "first",
            Self::BadImage(_) => "bad_image",
            Self::MissingRight => "missing_right",
            Self::BadTime => "bad_time",
            Self::Unsolvable(Unsolvable::FewRows { .. }) => "few_rows",
            Self::Unsolvable(Unsolvable::Unobservable) => "unobservable",
            Self::Unsolvable(Unsolvable::NotFinite) => "not_finite",
            Self::Unsolvable(Unsolvable::NotConverged) => "not_converged",
        }
    }
}

/// Milliseconds spent in each stage of one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StageTimes {
    /// Pyramids and gradients.
    pub pyramids_ms: f64,
    /// Dense disparity.
    pub disparity_ms: f64,
    /// Corner tracks and the motion they predict.
    pub tracks_ms: f64,
    /// Dense flow.
    pub flow_ms: f64,
    /// φ and its covariance.
    pub estimate_ms: f64,
    /// Depth velocity and time to impact.
    pub maps_ms: f64,
}

/// Dense results of a frame pair, on the earlier frame's pixel grid.
#[derive(Debug, Clone)]
pub struct DenseResults {
    /// Disparity of the earlier frame.
    pub disparity: DisparityMap,
    /// Flow of the left camera to the later frame.
    pub flow: FlowField,
    /// VZ and time to impact.
    pub motion: MotionMaps,
}

/// What one frame says about motion since its reference frame.
#[derive(Debug, Clone)]
pub struct FrameMotion {
    /// This frame's index, counted over all frames pushed or skipped.
    pub frame: usize,
    /// The earlier frame that it was matched with.
    pub reference: Option<usize>,
    /// Time of this frame, in seconds.
    pub time_s: f64,
    /// Time since the reference, in seconds.
    pub dt_s: Option<f64>,
    /// φ over that interval, or why there is none.
    pub motion: Result<MotionEstimate, Unanswered>,
    /// By how much matches of left and right lie on different rows in the reference frame, in pixels:
    /// how well the pair is rectified.
    pub row_disagreement_px: Option<f64>,
    /// Time to impact of the nearest obstacle in the vehicle's window.
    pub impact: Option<TimeToImpact>,
    /// The maps, when observing densely.
    pub dense: Option<DenseResults>,
    /// Where the time went.
    pub stages: StageTimes,
}

/// Why a pipeline cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PipelineError {
    /// The rig cannot measure.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The choices do not fit together.
    #[error(transparent)]
    Config(#[from] ConfigError),
}

/// Turns a sequence of stereo frames into motion.
///
/// Feed it one frame after the other; it keeps the last good frame and what was computed of it.
#[derive(Debug)]
pub struct StereoMotion {
    rig: StereoRig,
    config: Config,
    matcher: DisparityMatcher,
    mask: Option<Grid<bool>>,
    frames: usize,
    last_time_s: Option<f64>,
    reference: Option<Reference>,
    /// Velocity per second from the last answer.
    velocity: Option<Twist>,
    /// Frames since the reference that gave no answer though their images were good.
    failures: usize,
}

/// A frame that later ones are matched with.
#[derive(Debug)]
struct Reference {
    frame: usize,
    time_s: f64,
    images: StereoPyramid,
    disparity: Option<DisparityMap>,
}

/// After this many good frames without an answer the reference itself is given up.
const MOST_FAILURES: usize = 2;

/// Standard deviation of an offset of disparity per pixel by which rows disagree.
///
/// Rows show only the vertical part of a wrong calibration; yaw, focal lengths and distortion act
/// along rows as well. On the four KITTI scenes with laser truth the horizontal offset is 0.6 to 3.1
/// times the vertical one; this is the cautious end.
const OFFSET_PER_ROW_DISAGREEMENT: f64 = 3.0;

/// Least standard deviation of the grey levels of a usable image.
const LEAST_CONTRAST: f64 = 1.0;

impl StereoMotion {
    /// A pipeline for one rig.
    ///
    /// # Errors
    /// [`PipelineError`] when the rig cannot measure or the choices do not fit together.
    pub fn new(rig: StereoRig, config: Config) -> Result<Self, PipelineError> {
        rig.check()?;
        config.check()?;
        Ok(Self {
            rig,
            matcher: DisparityMatcher::new(config.disparity.clone()),
            config,
            mask: None,
            frames: 0,
            last_time_s: None,
            reference: None,
            velocity: None,
            failures: 0,
        })
    }

    /// The rig.
    pub fn rig(&self) -> &StereoRig {
        &self.rig
    }

    /// Pixels of the left image that are never used (a bonnet, a rotor), where `true`.
    pub fn set_mask(&mut self, mask: Option<Grid<bool>>) {
        self.mask = mask;
    }

    /// The frame that the next one will be matched with.
    pub fn reference(&self) -> Option<usize> {
        self.reference.as_ref().map(|reference| reference.frame)
    }

    /// Account for a frame that could not be read: it gets a row, and the next frame bridges it.
    pub fn skip(&mut self, time_s: f64, why: Unanswered) -> FrameMotion {
        let frame = self.frames;
        self.frames += 1;
        FrameMotion {
            frame,
            reference: self.reference.as_ref().map(|r| r.frame),
            time_s,
            dt_s: self.reference.as_ref().map(|r| time_s - r.time_s),
            motion: Err(why),
            row_disagreement_px: None,
            impact: None,
            dense: None,
            stages: StageTimes::default(),
        }
    }

    /// The motion from the last good frame to this one.
    pub fn push(&mut self, frame: StereoFrame) -> FrameMotion {
        if let Err(why) = self.usable(&frame) {
            return self.skip(frame.time_s, why);
        }
        self.last_time_s = Some(frame.time_s);
        let mut stages = StageTimes::default();
        let images = timed(&mut stages.pyramids_ms, || {
            StereoPyramid::new(frame.left, frame.right, self.config.tracks.pyramid_levels)
        });
        let disparity = (self.config.observe == Observe::Dense).then(|| {
            timed(&mut stages.disparity_ms, || {
                let (left, right) = (&images.left.levels()[0], &images.right.levels()[0]);
                let mut map = self.matcher.compute(left, right).ok()?;
                if let Some(mask) = &self.mask {
                    erase(&mut map.shift, mask);
                }
                Some(map)
            })
        });
        let here =
            Reference { frame: self.frames, time_s: frame.time_s, images, disparity: disparity.flatten() };
        let Some(before) = self.reference.take() else {
            let first = self.skip(here.time_s, Unanswered::First);
            self.reference = Some(here);
            return first;
        };
        let mask = self.mask.as_ref();
        let pair = FramePair { before: &before, after: &here, rig: &self.rig, config: &self.config, mask };
        let result = pair.motion(self.velocity.as_ref(), &mut stages);
        let answer = FrameMotion {
            frame: self.frames,
            reference: Some(before.frame),
            time_s: here.time_s,
            dt_s: Some(pair.dt_s()),
            motion: result.motion,
            row_disagreement_px: result.row_disagreement_px,
            impact: result.impact,
            dense: result
                .flow
                .zip(result.maps)
                .zip(before.disparity.clone())
                .map(|((flow, motion), disparity)| DenseResults { disparity, flow, motion }),
            stages,
        };
        self.remember(&answer, before, here);
        answer
    }

    fn usable(&self, frame: &StereoFrame) -> Result<(), Unanswered> {
        let expected = (self.rig.width_px, self.rig.height_px);
        for (side, image) in [("left", &frame.left), ("right", &frame.right)] {
            if image.size() != expected {
                let ((w, h), (we, he)) = (image.size(), expected);
                return Err(Unanswered::BadImage(format!("the {side} image is {w}x{h}, the rig {we}x{he}")));
            }
            let contrast = contrast(image);
            if contrast.is_nan() {
                return Err(Unanswered::BadImage(format!(
                    "the {side} image has values that are not numbers"
                )));
            }
            if contrast < LEAST_CONTRAST {
                return Err(Unanswered::BadImage(format!("the {side} image is constant")));
            }
        }
        let increases = self.last_time_s.is_none_or(|last| frame.time_s > last);
        if increases && frame.time_s.is_finite() { Ok(()) } else { Err(Unanswered::BadTime) }
    }

    /// Keep what the next frame needs.
    fn remember(&mut self, answer: &FrameMotion, before: Reference, here: Reference) {
        self.frames += 1;
        self.failures = if answer.motion.is_ok() { 0 } else { self.failures + 1 };
        let keep_old = answer.motion.is_err() && self.failures < MOST_FAILURES;
        self.velocity = match (&answer.motion, answer.dt_s) {
            (Ok(motion), Some(dt)) if motion.is_complete() => Some(motion.phi().scaled(1.0 / dt)),
            _ => None,
        };
        self.reference = Some(if keep_old { before } else { here });
    }
}

fn timed<T>(total_ms: &mut f64, run: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let value = run();
    *total_ms += start.elapsed().as_secs_f64() * 1e3;
    value
}

/// Standard deviation of the grey levels.
fn contrast(image: &Image) -> f64 {
    let n = image.values().len() as f64;
    let mean = image.values().iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    (image.values().iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// Clear the pixels that the mask excludes.
fn erase(field: &mut Field, mask: &Grid<bool>) {
    for v in 0..field.height().min(mask.height()) {
        for (value, &masked) in field.row_mut(v).iter_mut().zip(mask.row(v)) {
            if masked {
                *value = f32::NAN;
            }
        }
    }
}

/// Two frames to be compared.
struct FramePair<'a> {
    before: &'a Reference,
    after: &'a Reference,
    rig: &'a StereoRig,
    config: &'a Config,
    mask: Option<&'a Grid<bool>>,
}

struct PairResult {
    motion: Result<MotionEstimate, Unanswered>,
    row_disagreement_px: Option<f64>,
    impact: Option<TimeToImpact>,
    flow: Option<FlowField>,
    maps: Option<MotionMaps>,
}

impl FramePair<'_> {
    fn dt_s(&self) -> f64 {
        self.after.time_s - self.before.time_s
    }

    /// Observe, constrain and estimate; then what the motion means for every pixel.
    fn motion(&self, velocity: Option<&Twist>, stages: &mut StageTimes) -> PairResult {
        let prior = velocity.map(|v| v.scaled(self.dt_s()));
        let (tracks, rough) = timed(&mut stages.tracks_ms, || self.tracks(prior.as_ref()));
        match self.config.observe {
            Observe::Sparse => self.sparse(&tracks, rough, stages),
            Observe::Dense => self.dense(&tracks, rough, stages),
        }
    }

    /// Corner tracks, twice: the first pass finds the motion that guides the second.
    fn tracks(&self, prior: Option<&Twist>) -> (Vec<StereoTrack>, Result<Twist, Unsolvable>) {
        let first = self.rough(&self.track(prior), prior);
        // A wrong prior leaves few tracks; then search without it.
        let first = match (first, prior) {
            (Err(_), Some(_)) => self.rough(&self.track(None), None),
            (first, _) => first,
        };
        match first {
            Ok(rough) => {
                let tracks = self.track(Some(&rough));
                let refined = self.rough(&tracks, Some(&rough));
                (tracks, refined)
            }
            Err(why) => (Vec::new(), Err(why)),
        }
    }

    fn track(&self, motion: Option<&Twist>) -> Vec<StereoTrack> {
        let shift = self.before.disparity.as_ref().map(|d| &d.shift);
        let hints = Hints { shift, motion, mask: self.mask };
        stereo_tracks(&self.before.images, &self.after.images, self.rig, hints, &self.config.tracks)
    }

    /// The motion of most tracks.
    fn rough(&self, tracks: &[StereoTrack], prior: Option<&Twist>) -> Result<Twist, Unsolvable> {
        let own = &self.config.maximum_likelihood;
        let options = &MaximumLikelihoodOptions { seed: own.seed ^ self.config.seed, ..*own };
        let start = robust_start(tracks, self.rig, prior, options)?;
        Ok(maximum_likelihood(tracks, self.rig, &start, None, &options.kernel)?.motion.phi())
    }

    fn sparse(
        &self,
        tracks: &[StereoTrack],
        rough: Result<Twist, Unsolvable>,
        stages: &mut StageTimes,
    ) -> PairResult {
        let motion = timed(&mut stages.estimate_ms, || {
            solve(&Observed::Sparse(tracks), self.rig, &rough?, self.config)
        });
        let rows = row_disagreement(&self.before.images, tracks, self.rig);
        let impact = self.rigid(tracks, motion.as_ref().ok(), rows).and_then(|rigid| {
            nearest(&mut track_neighbourhoods(tracks, &rigid, self.rig, self.config, self.dt_s()))
        });
        PairResult {
            motion: motion.map_err(Unanswered::from),
            row_disagreement_px: rows,
            impact,
            flow: None,
            maps: None,
        }
    }

    fn dense(
        &self,
        tracks: &[StereoTrack],
        rough: Result<Twist, Unsolvable>,
        stages: &mut StageTimes,
    ) -> PairResult {
        let nothing = |why| PairResult {
            motion: Err(why),
            row_disagreement_px: None,
            impact: None,
            flow: None,
            maps: None,
        };
        let (Some(before), Some(after)) = (&self.before.disparity, &self.after.disparity) else {
            return nothing(Unanswered::Unsolvable(Unsolvable::FewRows { rows: 0, needed: 6 }));
        };
        let differential = self.config.approach == Approach::Differential;
        let both = differential && matches!(self.config.method, Method::Dv | Method::Joint | Method::Ml);
        let prediction = rough.as_ref().ok();
        let (flow, right) = timed(&mut stages.flow_ms, || {
            let images = (&self.before.images, &self.after.images);
            let left = self.flow(
                &images.0.left,
                &images.1.left,
                prediction.map(|phi| self.rigid_flow(before, phi, false)),
            );
            let right = both.then(|| {
                self.flow(
                    &images.0.right,
                    &images.1.right,
                    prediction.map(|phi| self.rigid_flow(before, phi, true)),
                )
            });
            (left, right.flatten())
        });
        let Some(flow) = flow else {
            return nothing(Unanswered::Unsolvable(Unsolvable::FewRows { rows: 0, needed: 6 }));
        };
        let pair = DensePair { rig: self.rig, before, after, flow: &flow, flow_right: right.as_ref() };
        let start = rough.unwrap_or_else(|_| Twist::zero());
        let motion = timed(&mut stages.estimate_ms, || {
            solve(&Observed::Dense(pair, tracks), self.rig, &start, self.config)
        });
        let rows = row_disagreement(&self.before.images, tracks, self.rig);
        let (maps, mut seen) = timed(&mut stages.maps_ms, || {
            let rigid = self.rigid(tracks, motion.as_ref().ok(), rows);
            motion_maps(&pair, rigid.as_ref(), self.config, self.dt_s())
        });
        PairResult {
            motion: motion.map_err(Unanswered::from),
            row_disagreement_px: rows,
            impact: nearest(&mut seen),
            maps: Some(maps),
            flow: Some(flow),
        }
    }

    /// What every pixel would do as part of the still world.
    fn rigid(
        &self,
        tracks: &[StereoTrack],
        motion: Option<&MotionEstimate>,
        row_disagreement_px: Option<f64>,
    ) -> Option<RigidPrediction<'_>> {
        let motion = motion?;
        let kernel = &self.config.maximum_likelihood.kernel;
        let common = common_errors(tracks, self.rig, &motion.phi(), kernel);
        let offset = common.map_or_else(DisparityOffset::none, |common| DisparityOffset {
            sigma_px: OFFSET_PER_ROW_DISAGREEMENT * row_disagreement_px.unwrap_or(0.0),
            phi_per_px: common.by_disparity_offset,
        });
        RigidPrediction::new(&motion.theta, offset, self.rig)
    }

    fn flow(&self, from: &Pyramid, to: &Pyramid, initial: Option<FlowField>) -> Option<FlowField> {
        dense_flow(from, to, initial.as_ref(), &self.config.flow).ok()
    }

    /// The flow of the still world under φ, on the pixel grid of the left or the right camera.
    fn rigid_flow(&self, before: &DisparityMap, phi: &Twist, right: bool) -> FlowField {
        let (width, height) = before.shift.size();
        let mut flow = (Field::missing(width, height), Field::missing(width, height));
        let motion: RigidMotion = phi.exp();
        for v in 0..height {
            for u in 0..width {
                let Some(shift) = before.shift.get(u, v).map(f64::from) else { continue };
                let d = self.rig.disparity_from_shift(shift);
                let (x, y) = self.rig.image_from_pixel(u as f64, v as f64);
                let point = self.rig.point(&nalgebra::Vector3::new(x, y, d));
                let Some(after) = point.and_then(|p| self.rig.project(&motion.apply(&p))) else { continue };
                let (u_after, v_after) = self.rig.pixel_from_image(after.x, after.y);
                let (du, dv) = (u_after - u as f64, (v_after - v as f64) as f32);
                let (at, du) =
                    if right { ((u as f64 - shift).round(), du - (after.z - d)) } else { (u as f64, du) };
                if at >= 0.0 && at < width as f64 {
                    flow.0.set(at as usize, v, Some(du as f32));
                    flow.1.set(at as usize, v, Some(dv));
                }
            }
        }
        FlowField::prediction(flow.0, flow.1)
    }
}
