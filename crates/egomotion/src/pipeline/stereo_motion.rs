//! Frames in, motion out: keeps what one frame needs of the ones before.

use super::answer::{DenseResults, FrameMotion, Unanswered};
use super::config::{Config, Observe, PipelineError};
use super::frame::{Frame, PreparedFrame, correct, erase, erase_partners, sized};
use super::frame_pair::{Compared, FramePair};
use super::memory::{Earlier, KeptFrame, Memory};
use super::stages::{StageTimes, timed};
use crate::geometry::{Grid, StereoRig, Twist};
use crate::observe::flow::FlowSpace;
use crate::observe::{DisparityMap, DisparityMatcher, FlowField, StereoPyramid};

/// The memory of a [`StereoMotion`].
pub type StereoMemory = Memory<KeptFrame>;

/// Turns a sequence of stereo frames into motion.
///
/// Feed it one frame after the other; it keeps the last good frame and what was computed of it. A bad frame gives an
/// answer that says why, and the next good one is matched with the last good one. When that fails several times in a
/// row, the newest frame is tried too.
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
    memory: Memory<PreparedFrame>,
    flow_space: FlowSpace,
    /// The images of a frame that is no longer needed: the next ones take their place.
    spare: Option<StereoPyramid>,
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
            memory: Memory::new(),
            flow_space: FlowSpace::default(),
            spare: None,
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
        let next = self.memory.next_frame();
        if let Some(last) = self.memory.earlier_mut().find(|frame| frame.frame + 1 == next) {
            last.flow = Some(flow);
        }
        Ok(())
    }

    /// The frame that the next one will be matched with first.
    pub fn reference(&self) -> Option<usize> {
        self.memory.reference().map(|reference| reference.frame)
    }

    /// Account for a frame that could not be read: it gets a row, and the next frame bridges it.
    pub fn skip(&mut self, time_s: f64, why: Unanswered) -> FrameMotion {
        self.memory.skip(time_s, why)
    }

    /// The motion from the last good frame to this one.
    pub fn push(&mut self, frame: impl Into<Frame>) -> FrameMotion {
        let frame = frame.into();
        if let Err(why) = self.usable(&frame) {
            return self.skip(frame.time_s, why);
        }
        self.memory.set_time(frame.time_s);
        let mut stages = StageTimes::default();
        let blank = frame.is_blank();
        let here = self.prepared(frame, self.memory.next_frame(), &mut stages);
        let Some(earlier) = self.memory.take_earlier() else {
            let first = self.skip(here.time_s, Unanswered::First);
            self.memory.set_earlier(Earlier::only(here));
            return first;
        };
        let repeats = earlier.iter().any(|before| here.repeats(before, blank));
        if repeats {
            self.memory.set_earlier(earlier);
            self.spare = Some(here.images);
            return self.skip(here.time_s, Unanswered::RepeatedFrame);
        }
        self.answer(earlier, here, stages)
    }

    /// The answer of a frame and those before, and what the next one needs of them.
    fn answer(
        &mut self,
        mut earlier: Earlier<PreparedFrame>,
        here: PreparedFrame,
        mut stages: StageTimes,
    ) -> FrameMotion {
        let expected = self.memory.expected_motion(here.time_s - earlier.reference.time_s);
        let mut compared = self.compare(&earlier.reference, &here, expected.as_ref(), &mut stages);
        let mut before = &mut earlier.reference;
        if compared.answer.motion.is_err()
            && let Some(newest) = &mut earlier.newest
        {
            let other = self.compare(newest, &here, None, &mut stages);
            if other.answer.motion.is_ok() {
                (compared, before) = (other, newest);
            }
        }
        let Compared { mut answer, fields, corners } = compared;
        let last = answer.last.take();
        // After an answer the earlier frame is not needed again.
        let disparity =
            if answer.motion.is_ok() { before.disparity.take() } else { before.disparity.clone() };
        let dense =
            fields.zip(disparity).map(|((flow, motion), disparity)| DenseResults { disparity, flow, motion });
        let moments = ((before.frame, before.time_s), (here.frame, here.time_s));
        let answer = FrameMotion::of_pair(moments.0, moments.1, answer, dense, stages);
        let gone = self.memory.remember(&answer, last, earlier, PreparedFrame { corners, ..here });
        self.spare = gone.map(|gone| gone.images);
        answer
    }

    /// Two frames, and the motion between them if it goes on as it was.
    fn compare(
        &mut self,
        before: &PreparedFrame,
        here: &PreparedFrame,
        expected: Option<&Twist>,
        stages: &mut StageTimes,
    ) -> Compared {
        let masks = [self.mask.as_ref(), self.mask_right.as_ref()];
        let pair = FramePair::new(before, here, &self.rig, &self.config, masks, self.memory.shared());
        pair.compare(expected, &mut self.flow_space, stages)
    }

    /// What is kept of the frames so far: with it, and the frame that it names, [`StereoMotion::recall`] goes on.
    pub fn memory(&self) -> StereoMemory {
        self.memory.kept(|reference| KeptFrame {
            frame: reference.frame,
            time_s: reference.time_s,
            corners: reference.corners.clone(),
        })
    }

    /// Go on where a pipeline of the same rig, choices and mask had this memory: every later answer is the same,
    /// bit for bit. `frame` gives a frame again by its index: the one that [`StereoMemory::reference_frame`] names, and
    /// after several without an answer one more.
    ///
    /// # Errors
    /// Why a frame cannot be used; the pipeline then stays as it was.
    pub fn recall(
        &mut self,
        memory: StereoMemory,
        mut frame: impl FnMut(usize) -> Result<Frame, Unanswered>,
    ) -> Result<(), Unanswered> {
        self.memory = memory.restored(|kept| -> Result<PreparedFrame, Unanswered> {
            let frame = frame(kept.frame)?;
            frame.check(&self.rig)?;
            let prepared = self.prepared(frame, kept.frame, &mut StageTimes::default());
            Ok(PreparedFrame { time_s: kept.time_s, corners: kept.corners, ..prepared })
        })?;
        Ok(())
    }

    /// A frame with all that is computed of it alone.
    fn prepared(&mut self, frame: Frame, index: usize, stages: &mut StageTimes) -> PreparedFrame {
        let images = timed(&mut stages.pyramids_ms, || {
            let mut images = self.spare.take().unwrap_or_default();
            images.renew(&frame.left, frame.right.as_ref(), self.config.tracks.pyramid_levels);
            images
        });
        let disparity = timed(&mut stages.disparity_ms, || self.disparity(frame.disparity, &images));
        let Frame { time_s, flow, .. } = frame;
        PreparedFrame { frame: index, time_s, images, disparity, flow, corners: Vec::new() }
    }

    /// The given disparity, or that of the images when observing densely, without what is masked.
    fn disparity(&mut self, given: Option<DisparityMap>, images: &StereoPyramid) -> Option<DisparityMap> {
        let matched = given.is_none();
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
        let known = self.config.rig_errors.values();
        if matched && !known.is_none() {
            correct(&mut map.shift, &known, &self.rig);
        }
        Some(map)
    }

    fn usable(&self, frame: &Frame) -> Result<(), Unanswered> {
        frame.check(&self.rig)?;
        self.memory.check_time(frame.time_s)
    }
}
