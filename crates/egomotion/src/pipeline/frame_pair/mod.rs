//! Two frames compared, as the paper's list of sections: observe, constrain and estimate, and say what the motion means.

mod corners;
mod flows;

use super::answer::{PairAnswer, Unanswered};
use super::config::{Config, Observe};
use super::frame::PreparedFrame;
use super::interpret::{self, Meaning, MotionMaps};
use super::plan::Interval;
use super::shared::Shared;
use super::solve::{Contradiction, Observed, PairMotion, contradiction, refined_motion, solve, whole_motion};
use super::stages::{StageTimes, timed};
use crate::estimate::{LastMotion, MotionEstimate, SolvedMotion, TrackSource, Unsolvable};
use crate::geometry::{Grid, RigErrors, StereoRig, Twist};
use crate::observe::flow::FlowSpace;
use crate::observe::tracks::StereoCorner;
use crate::observe::{DensePair, FlowField, StereoPyramid, row_disagreement};
use corners::FollowedCorners;
use flows::Flows;

/// Why there is no motion where disparity or flow is missing as a whole.
const NOTHING_OBSERVED: Unsolvable = Unsolvable::FewRows { rows: 0, needed: 6 };

/// Two frames to be compared.
pub(super) struct FramePair<'a> {
    before: &'a PreparedFrame,
    after: &'a PreparedFrame,
    interval: Interval<'a>,
    /// Pixels of the left and of the right image never to use.
    masks: [Option<&'a Grid<bool>>; 2],
    shared: &'a Shared,
}

/// What two frames give: the answer, what it leaves behind of every pixel, and the corners in the later frame.
pub(super) struct Compared {
    pub(super) answer: PairAnswer,
    pub(super) fields: Option<(FlowField, MotionMaps)>,
    pub(super) corners: Vec<StereoCorner>,
}

impl<'a> FramePair<'a> {
    /// Two frames of a rig, the pixels of its images that are never used, and what it shares with the pairs before.
    pub(super) fn new(
        before: &'a PreparedFrame,
        after: &'a PreparedFrame,
        rig: &'a StereoRig,
        config: &'a Config,
        masks: [Option<&'a Grid<bool>>; 2],
        shared: &'a Shared,
    ) -> Self {
        let both_right = before.images.has_right() && after.images.has_right();
        let both_maps = before.disparity.is_some() && after.disparity.is_some();
        let source = if both_maps && !both_right { TrackSource::Image } else { TrackSource::Stereo };
        let interval = Interval::new(rig, config, source, after.time_s - before.time_s);
        Self { before, after, interval, masks, shared }
    }

    /// Observe, estimate and interpret. `expected` is the motion if it goes on as it was.
    pub(super) fn compare(
        &self,
        expected: Option<&Twist>,
        space: &mut FlowSpace,
        stages: &mut StageTimes,
    ) -> Compared {
        let corners = timed(&mut stages.tracks_ms, || self.follow_corners(expected));
        let rows = row_disagreement(&self.before.images, &corners.tracks, self.interval.rig);
        let (answer, fields) = match self.interval.plan.observe {
            Observe::Sparse => (self.answer_of_tracks(&corners, rows, stages), None),
            Observe::Dense => match self.answer_of_fields(&corners, rows, space, stages) {
                Some((answer, flow, maps)) => (answer, Some((flow, maps))),
                None => (PairAnswer::none(NOTHING_OBSERVED), None),
            },
        };
        Compared { answer, fields, corners: corners.later }
    }

    /// The answer of tracks alone.
    fn answer_of_tracks(
        &self,
        corners: &FollowedCorners,
        rows: Option<f64>,
        stages: &mut StageTimes,
    ) -> PairAnswer {
        let observed = Observed::Tracks(&corners.tracks);
        let solved = timed(&mut stages.estimate_ms, || {
            let start = corners.motion.as_ref().map_err(|why| *why)?;
            solve(&observed, &self.interval, Some(start))
        });
        let by_corners = || self.refined(corners);
        let contradiction = self.contradiction(solved.as_ref().ok(), by_corners, &observed);
        let (motion, last, rig_sigma) = self.whole(solved, corners, rows);
        let obstacle = interpret::tracks(&corners.tracks, motion.as_ref().ok(), &self.interval);
        let moving = Vec::new();
        PairAnswer { motion, last, rig_sigma, row_disagreement_px: rows, contradiction, obstacle, moving }
    }

    /// The answer of every pixel: flows, observations, φ, and what it means.
    fn answer_of_fields(
        &self,
        corners: &FollowedCorners,
        rows: Option<f64>,
        space: &mut FlowSpace,
        stages: &mut StageTimes,
    ) -> Option<(PairAnswer, FlowField, MotionMaps)> {
        let refined = timed(&mut stages.tracks_ms, || self.refined(corners));
        let start = refined.as_ref().map(MotionEstimate::phi_or_zero);
        let flows = timed(&mut stages.flow_ms, || self.flows(start.as_ref(), space))?;
        let fields = self.observe(&flows)?;
        let observed = Observed::Fields(fields, &corners.tracks);
        let solved = timed(&mut stages.estimate_ms, || solve(&observed, &self.interval, start.as_ref()));
        let contradiction = self.contradiction(solved.as_ref().ok(), || refined, &observed);
        let (motion, last, rig_sigma) = self.whole(solved, corners, rows);
        let Meaning { maps, moving, obstacle } = timed(&mut stages.maps_ms, || {
            interpret::fields(&fields, self.images(), motion.as_ref().ok(), &self.interval)
        });
        let answer = PairAnswer {
            motion,
            last,
            rig_sigma,
            row_disagreement_px: rows,
            contradiction,
            obstacle,
            moving,
        };
        Some((answer, flows.left, maps))
    }

    /// The whole uncertainty of a motion, what the next pair needs of it, and standard deviations of the rig's errors.
    fn whole(
        &self,
        solved: Result<SolvedMotion, Unsolvable>,
        corners: &FollowedCorners,
        rows: Option<f64>,
    ) -> (Result<PairMotion, Unanswered>, Option<LastMotion>, RigErrors) {
        let Interval { rig, config, .. } = self.interval;
        let rig_sigma = self.shared.rig_sigma(rows, config, rig);
        let last = self.shared.last_until(self.before.frame);
        match solved {
            Ok(solved) => {
                let (motion, last) = whole_motion(solved, &corners.tracks, &self.interval, &rig_sigma, last);
                (Ok(motion), last, rig_sigma)
            }
            Err(why) => (Err(why.into()), None, rig_sigma),
        }
    }

    /// The first motion, refined on all tracks: it predicts flow, and the estimate begins with it.
    fn refined(&self, corners: &FollowedCorners) -> Option<MotionEstimate> {
        refined_motion(&corners.tracks, &self.interval, corners.motion.as_ref().ok()?).ok()
    }

    /// Where corners contradict the answer of a method that linearises.
    fn contradiction(
        &self,
        motion: Option<&SolvedMotion>,
        by_corners: impl FnOnce() -> Option<MotionEstimate>,
        observed: &Observed<'_>,
    ) -> Option<Contradiction> {
        let motion = motion.filter(|_| self.interval.plan.equations.are_linear())?;
        contradiction(&motion.motion, &by_corners()?, observed, &self.interval)
    }

    /// What every pixel shows: disparity of both frames, and the flows between them.
    fn observe<'b>(&'b self, flows: &'b Flows) -> Option<DensePair<'b>> {
        Some(DensePair {
            rig: self.interval.rig,
            before: self.before.disparity.as_ref()?,
            after: self.after.disparity.as_ref()?,
            flow: &flows.left,
            flow_right: flows.right.as_ref(),
            external_disparity: self.interval.plan.source == TrackSource::Image,
        })
    }

    fn images(&self) -> (&StereoPyramid, &StereoPyramid) {
        (&self.before.images, &self.after.images)
    }
}
