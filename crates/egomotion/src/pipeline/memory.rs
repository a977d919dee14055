//! What goes on from frame to frame, be they images or tracks.
//!
//! Without images it is small enough for a file. It has no fixed length in frames: a corner may be followed as long as
//! it is seen. So an interrupted sequence does not go on by pushing its last few frames again, but from here, and then
//! to the same bits.

use serde::{Deserialize, Serialize};

use super::answer::{FrameMotion, Unanswered};
use super::shared::Shared;
use crate::estimate::LastMotion;
use crate::geometry::Twist;
use crate::observe::tracks::StereoCorner;

/// After this many good frames without an answer the reference frame may be the bad one: the newest is tried beside it.
const FAILURES_UNTIL_DOUBTED: usize = 2;

/// A frame that later ones can be matched with.
pub trait TimedFrame {
    /// Index, counted over all frames pushed or skipped, and time in seconds.
    fn moment(&self) -> (usize, f64);
}

/// The frames that a new one is matched with, in this order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Earlier<F> {
    /// The last frame that took part in an answer, or the first of all.
    pub(super) reference: F,
    /// The newest frame, after several in a row gave no answer with the reference.
    pub(super) newest: Option<F>,
}

impl<F> Earlier<F> {
    pub(super) fn only(reference: F) -> Self {
        Self { reference, newest: None }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &F> {
        [&self.reference].into_iter().chain(&self.newest)
    }

    fn map<G>(self, mut change: impl FnMut(F) -> G) -> Earlier<G> {
        Earlier { reference: change(self.reference), newest: self.newest.map(change) }
    }
}

/// What a pipeline keeps of the frames that it has seen; `F` is what it keeps of one that later ones are matched with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Memory<F> {
    /// Frames pushed or skipped so far.
    frames: usize,
    /// The last time stamp that could be used.
    last_time_s: Option<f64>,
    /// The frames that the next one is matched with.
    earlier: Option<Earlier<F>>,
    /// Velocity per second of the last answer.
    velocity: Option<Twist>,
    /// Frames since the reference that gave no answer though they were good.
    failures: usize,
    /// What all pairs share.
    shared: Shared,
}

impl<F> Memory<F> {
    /// Of no frame yet.
    pub(super) fn new() -> Self {
        Self {
            frames: 0,
            last_time_s: None,
            earlier: None,
            velocity: None,
            failures: 0,
            shared: Shared::default(),
        }
    }

    /// Index that the next frame has.
    pub(super) fn next_frame(&self) -> usize {
        self.frames
    }

    /// The frame that the next one is matched with first.
    pub(super) fn reference(&self) -> Option<&F> {
        self.earlier.as_ref().map(|earlier| &earlier.reference)
    }

    pub(super) fn earlier_mut(&mut self) -> impl Iterator<Item = &mut F> {
        self.earlier
            .iter_mut()
            .flat_map(|earlier| [&mut earlier.reference].into_iter().chain(&mut earlier.newest))
    }

    pub(super) fn take_earlier(&mut self) -> Option<Earlier<F>> {
        self.earlier.take()
    }

    pub(super) fn set_earlier(&mut self, earlier: Earlier<F>) {
        self.earlier = Some(earlier);
    }

    /// Whether a time can follow the last one.
    ///
    /// # Errors
    /// [`Unanswered::BadTime`] if it cannot.
    pub(super) fn check_time(&self, time_s: f64) -> Result<(), Unanswered> {
        let increases = self.last_time_s.is_none_or(|last| time_s > last);
        if increases && time_s.is_finite() { Ok(()) } else { Err(Unanswered::BadTime) }
    }

    pub(super) fn set_time(&mut self, time_s: f64) {
        self.last_time_s = Some(time_s);
    }

    /// The motion over `dt_s` seconds, if it goes on as it was.
    pub(super) fn expected_motion(&self, dt_s: f64) -> Option<Twist> {
        self.velocity.map(|velocity| velocity.scaled(dt_s))
    }

    /// What all pairs share.
    pub(super) fn shared(&self) -> &Shared {
        &self.shared
    }

    /// What is left of it when `keep` has taken what it needs of each frame.
    pub(super) fn kept<G>(&self, keep: impl Fn(&F) -> G) -> Memory<G> {
        let earlier = self.earlier.as_ref().map(|Earlier { reference, newest }| Earlier {
            reference: keep(reference),
            newest: newest.as_ref().map(&keep),
        });
        let Self { frames, last_time_s, velocity, failures, ref shared, .. } = *self;
        Memory { frames, last_time_s, earlier, velocity, failures, shared: shared.clone() }
    }

    /// The same memory with something else kept of each frame.
    pub(super) fn map<G>(mut self, change: impl FnMut(F) -> G) -> Memory<G> {
        let earlier = self.earlier.take().map(|earlier| earlier.map(change));
        self.with_earlier(earlier)
    }

    /// The memory again, with the frames that `restore` makes of what was kept.
    ///
    /// # Errors
    /// Those of `restore`.
    pub(super) fn restored<G, E>(
        mut self,
        mut restore: impl FnMut(F) -> Result<G, E>,
    ) -> Result<Memory<G>, E> {
        let earlier = match self.earlier.take() {
            Some(Earlier { reference, newest }) => {
                Some(Earlier { reference: restore(reference)?, newest: newest.map(restore).transpose()? })
            }
            None => None,
        };
        Ok(self.with_earlier(earlier))
    }

    fn with_earlier<G>(self, earlier: Option<Earlier<G>>) -> Memory<G> {
        let Self { frames, last_time_s, velocity, failures, shared, .. } = self;
        Memory { frames, last_time_s, earlier, velocity, failures, shared }
    }
}

impl<F: TimedFrame> Memory<F> {
    /// Count a frame that gives no motion; what it would be matched with stays.
    pub(super) fn skip(&mut self, time_s: f64, why: Unanswered) -> FrameMotion {
        let reference = self.reference().map(F::moment);
        self.count_unanswered(time_s, reference, why)
    }

    /// Count a frame that gives no motion since the frame of a moment.
    pub(super) fn count_unanswered(
        &mut self,
        time_s: f64,
        reference: Option<(usize, f64)>,
        why: Unanswered,
    ) -> FrameMotion {
        let frame = self.frames;
        self.frames += 1;
        FrameMotion::unanswered((frame, time_s), reference, why)
    }

    /// Keep what the next frame needs of an answer, and return a frame that is not needed again.
    ///
    /// After a failure the reference stays, however many frames fail: a robot that saw nothing for a while is then matched
    /// with what it saw before.
    pub(super) fn remember(
        &mut self,
        answer: &FrameMotion,
        last: Option<LastMotion>,
        earlier: Earlier<F>,
        here: F,
    ) -> Option<F> {
        self.shared.remember(answer.row_disagreement_px, last.map(|last| (self.frames, last)));
        self.frames += 1;
        self.failures = if answer.motion.is_ok() { 0 } else { self.failures + 1 };
        self.velocity = match (&answer.motion, answer.dt_s) {
            (Ok(motion), Some(dt)) if motion.is_complete() => Some(motion.phi().scaled(1.0 / dt)),
            _ => None,
        };
        let Earlier { reference, newest } = earlier;
        let (kept, gone) = match (answer.motion.is_ok(), self.failures < FAILURES_UNTIL_DOUBTED) {
            (true, _) => (Earlier::only(here), Some(reference)),
            (false, true) => (Earlier { reference, newest }, Some(here)),
            (false, false) => (Earlier { reference, newest: Some(here) }, newest),
        };
        self.earlier = Some(kept);
        gone
    }
}

/// What is kept of a frame of images: where corners were followed to. All else is computed again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptFrame {
    pub(super) frame: usize,
    pub(super) time_s: f64,
    pub(super) corners: Vec<StereoCorner>,
}

impl Memory<KeptFrame> {
    /// Index of the frame that the next one is matched with, counted over all frames pushed or skipped.
    pub fn reference_frame(&self) -> Option<usize> {
        self.reference().map(|reference| reference.frame)
    }
}
