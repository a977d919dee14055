//! Frames in, motion out: keeps what one frame needs of the ones before.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::config::{Config, ConfigError, Observe};
use super::frame::{Frame, erase, erase_partners, sized};
use super::frame_pair::{FramePair, Reference, timed};
use super::groups::MovingGroup;
use super::maps::MotionMaps;
use super::memory::{KeptFrame, StereoMemory};
use super::unanswered::Unanswered;
use crate::estimate::MotionEstimate;
use crate::geometry::{Grid, RigError, StereoRig, Twist};
use crate::motion::{NoObstacle, Obstacle, TimeToImpact};
use crate::observe::flow::FlowSpace;
use crate::observe::{DisparityMap, DisparityMatcher, FlowField, StereoPyramid};

/// Milliseconds spent in each stage of one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Serialize, Deserialize)]
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
    /// The nearest obstacle that will pass through the vehicle's window, or why there is none.
    pub obstacle: Result<Obstacle, NoObstacle>,
    /// What moves by itself, the largest group first; found when observing densely.
    pub moving: Vec<MovingGroup>,
    /// The maps, when observing densely; not kept where this is written to a file.
    #[serde(skip)]
    pub dense: Option<DenseResults>,
    /// Where the time went.
    pub stages: StageTimes,
}

impl FrameMotion {
    /// No answer for a frame at a time, beside the reference frame and its time.
    pub(super) fn unanswered(
        (frame, time_s): (usize, f64),
        reference: Option<(usize, f64)>,
        why: Unanswered,
    ) -> Self {
        Self {
            frame,
            reference: reference.map(|(frame, _)| frame),
            time_s,
            dt_s: reference.map(|(_, before_s)| time_s - before_s),
            motion: Err(why),
            row_disagreement_px: None,
            obstacle: Err(NoObstacle::NothingMeasured),
            moving: Vec::new(),
            dense: None,
            stages: StageTimes::default(),
        }
    }

    /// Time to impact of the nearest obstacle.
    pub fn impact(&self) -> Option<TimeToImpact> {
        self.obstacle.as_ref().ok().map(|obstacle| obstacle.impact)
    }
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
/// Feed it one frame after the other; it keeps the last good frame and what was computed of it. A bad frame gives an
/// answer that says why, and the next good one is matched with the last good one.
///
/// ```
/// use egomotion::pipeline::{Config, Observe, StereoFrame, StereoMotion, Unanswered};
/// use egomotion::sim::Sequence;
///
/// let camera = Sequence::named("drive", Some((320, 240)), Some(3), 1.0).ok_or("no such sequence")?;
/// let config = Config { observe: Observe::Sparse, ..Config::default() };
/// let mut motion = StereoMotion::new(camera.rig, config)?;
/// let frame = |k: usize| {
///     let images = camera.view(k).ok_or("no such frame")?.render(2);
///     Ok::<_, &str>(StereoFrame { time_s: 0.1 * k as f64, left: images.left, right: images.right })
/// };
///
/// assert_eq!(motion.push(frame(0)?).motion, Err(Unanswered::First));
/// let lost = motion.skip(0.1, Unanswered::MissingRight); // the frame 1 never came
/// assert_eq!((lost.frame, motion.reference()), (1, Some(0)));
///
/// let answer = motion.push(frame(2)?);
/// assert_eq!((answer.frame, answer.reference), (2, Some(0)));
/// let estimate = answer.motion?;
/// // The scene comes 50 mm nearer in each of the two intervals.
/// assert!((estimate.phi().t.z + 0.1).abs() < 0.002, "{:?}", estimate.phi());
/// assert!(estimate.is_complete() && estimate.theta.sigma(2) < 0.002);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct StereoMotion {
    rig: StereoRig,
    config: Config,
    matcher: DisparityMatcher,
    mask: Option<Grid<bool>>,
    mask_right: Option<Grid<bool>>,
    frames: usize,
    last_time_s: Option<f64>,
    reference: Option<Reference>,
    /// Velocity per second from the last answer.
    velocity: Option<Twist>,
    flow_space: FlowSpace,
    /// The memory of a frame that is no longer needed.
    spare: Option<StereoPyramid>,
    /// Frames since the reference that gave no answer though their images were good.
    failures: usize,
}

/// After this many good frames without an answer the reference itself is given up.
pub(super) const MOST_FAILURES: usize = 2;

/// What a map says, missing pixels included, for comparison.
fn bits(map: &DisparityMap) -> Vec<u32> {
    map.shift.grid().values().iter().map(|value| value.to_bits()).collect()
}

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
            mask_right: None,
            frames: 0,
            last_time_s: None,
            reference: None,
            velocity: None,
            flow_space: FlowSpace::default(),
            spare: None,
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

    /// Pixels of the right image that show nothing (beyond a lens or the raw image), where `true`: no disparity
    /// leads there.
    pub fn set_right_mask(&mut self, mask: Option<Grid<bool>>) {
        self.mask_right = mask;
    }

    /// Flow of the last frame's left image to the one that comes next: [`Frame::flow`] of whoever knows it only then.
    ///
    /// Nothing is done before the first frame; after a bad frame the flow is not used.
    ///
    /// # Errors
    /// [`Unanswered::BadImage`] when it is not of the rig's size.
    pub fn set_flow(&mut self, flow: FlowField) -> Result<(), Unanswered> {
        sized("flow", flow.size(), &self.rig)?;
        if let Some(last) = &mut self.reference {
            last.flow = Some(flow);
        }
        Ok(())
    }

    /// The frame that the next one will be matched with.
    pub fn reference(&self) -> Option<usize> {
        self.reference.as_ref().map(|reference| reference.frame)
    }

    /// Account for a frame that could not be read: it gets a row, and the next frame bridges it.
    pub fn skip(&mut self, time_s: f64, why: Unanswered) -> FrameMotion {
        let frame = self.frames;
        self.frames += 1;
        let reference = self.reference.as_ref().map(|r| (r.frame, r.time_s));
        FrameMotion::unanswered((frame, time_s), reference, why)
    }

    /// The motion from the last good frame to this one.
    pub fn push(&mut self, frame: impl Into<Frame>) -> FrameMotion {
        let frame = frame.into();
        if let Err(why) = self.usable(&frame) {
            return self.skip(frame.time_s, why);
        }
        self.last_time_s = Some(frame.time_s);
        let mut stages = StageTimes::default();
        let blank = frame.is_blank();
        let here = self.prepared(frame, &mut stages);
        let Some(mut before) = self.reference.take() else {
            let first = self.skip(here.time_s, Unanswered::First);
            self.reference = Some(here);
            return first;
        };
        let same_shape = || here.disparity.as_ref().map(bits) == before.disparity.as_ref().map(bits);
        if here.images.repeats(&before.images) && (!blank || same_shape()) {
            let repeated = self.skip(here.time_s, Unanswered::RepeatedFrame);
            (self.reference, self.spare) = (Some(before), Some(here.images));
            return repeated;
        }
        let masks = [self.mask.as_ref(), self.mask_right.as_ref()];
        let pair = FramePair { before: &before, after: &here, rig: &self.rig, config: &self.config, masks };
        let result = pair.motion(self.velocity.as_ref(), &mut self.flow_space, &mut stages);
        let dt_s = pair.dt_s();
        // After an answer the earlier frame is not needed again.
        let disparity =
            if result.motion.is_ok() { before.disparity.take() } else { before.disparity.clone() };
        let answer = FrameMotion {
            frame: self.frames,
            reference: Some(before.frame),
            time_s: here.time_s,
            dt_s: Some(dt_s),
            motion: result.motion,
            row_disagreement_px: result.row_disagreement_px,
            obstacle: result.obstacle,
            moving: result.moving,
            dense: result
                .flow
                .zip(result.maps)
                .zip(disparity)
                .map(|((flow, motion), disparity)| DenseResults { disparity, flow, motion }),
            stages,
        };
        self.remember(&answer, before, Reference { corners: result.corners, ..here });
        answer
    }

    /// What is kept of the frames so far: with it, and the frame that it names, [`StereoMotion::recall`] goes on.
    pub fn memory(&self) -> StereoMemory {
        let kept = |r: &Reference| KeptFrame { frame: r.frame, time_s: r.time_s, corners: r.corners.clone() };
        StereoMemory {
            frames: self.frames,
            last_time_s: self.last_time_s,
            reference: self.reference.as_ref().map(kept),
            velocity: self.velocity,
            failures: self.failures,
        }
    }

    /// Go on where a pipeline of the same rig, choices and mask had this memory: every later answer is the same,
    /// bit for bit. `frame` gives again the one with the index that [`StereoMemory::reference`] names.
    ///
    /// # Errors
    /// Why that frame cannot be used; the pipeline then stays as it was.
    pub fn recall(
        &mut self,
        memory: StereoMemory,
        frame: impl FnOnce(usize) -> Result<Frame, Unanswered>,
    ) -> Result<(), Unanswered> {
        let reference = memory.reference.map(|kept| -> Result<Reference, Unanswered> {
            let frame = frame(kept.frame)?;
            frame.check(&self.rig)?;
            let images = self.prepared(frame, &mut StageTimes::default());
            Ok(Reference { frame: kept.frame, time_s: kept.time_s, corners: kept.corners, ..images })
        });
        self.reference = reference.transpose()?;
        (self.frames, self.last_time_s) = (memory.frames, memory.last_time_s);
        (self.velocity, self.failures) = (memory.velocity, memory.failures);
        Ok(())
    }

    /// A frame with all that is computed of it alone.
    fn prepared(&mut self, frame: Frame, stages: &mut StageTimes) -> Reference {
        let images = timed(&mut stages.pyramids_ms, || {
            let mut images = self.spare.take().unwrap_or_default();
            images.renew(&frame.left, frame.right.as_ref(), self.config.tracks.pyramid_levels);
            images
        });
        let disparity = timed(&mut stages.disparity_ms, || self.disparity(frame.disparity, &images));
        let (frames, time_s) = (self.frames, frame.time_s);
        Reference { frame: frames, time_s, images, disparity, flow: frame.flow, corners: Vec::new() }
    }

    /// The given disparity, or that of the images when observing densely, without what is masked.
    fn disparity(&mut self, given: Option<DisparityMap>, images: &StereoPyramid) -> Option<DisparityMap> {
        let mut map = match (given, self.config.observe) {
            (Some(given), _) => given,
            (None, Observe::Sparse) => return None,
            (None, Observe::Dense) => {
                self.matcher.compute(images.left.levels().first()?, images.right.levels().first()?).ok()?
            }
        };
        if let Some(mask) = &self.mask {
            erase(&mut map.shift, mask);
        }
        if let Some(mask) = &self.mask_right {
            erase_partners(&mut map.shift, mask);
        }
        Some(map)
    }

    fn usable(&self, frame: &Frame) -> Result<(), Unanswered> {
        frame.check(&self.rig)?;
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
        let (kept, gone) = if keep_old { (before, here) } else { (here, before) };
        self.reference = Some(kept);
        self.spare = Some(gone.images);
    }
}
