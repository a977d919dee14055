//! What a random pair of frames shows, observed once for all linear methods.

use crate::consistency::pair::RandomPair;
use egomotion::estimate::{MotionEstimate, TrackSource, Unsolvable};
use egomotion::geometry::{StereoRig, Twist};
use egomotion::observe::disparity::DisparityError;
use egomotion::observe::flow::{FlowError, Side, rigid_flow};
use egomotion::observe::tracks::{Hints, stereo_tracks};
use egomotion::observe::{
    DensePair, DisparityMap, DisparityMatcher, FlowField, StereoPyramid, StereoTrack, dense_flow,
};
use egomotion::pipeline::plan::Interval;
use egomotion::pipeline::solve::{Contradiction, Observed, contradiction, solve};
use egomotion::pipeline::{Config, StereoFrame};
use thiserror::Error;

use super::DisparitySource;

/// Standard deviation that is stated of an exact disparity, in pixels: that of one handed in without any.
const STATED_SIGMA_PX: f32 = 0.3;

/// Why a pair could not be observed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ObservingError {
    /// The images of a pair differ in size.
    #[error(transparent)]
    Disparity(#[from] DisparityError),
    /// The images of both times differ in size.
    #[error(transparent)]
    Flow(#[from] FlowError),
}

/// Images, disparity, flow and tracks of two frames.
pub(super) struct ObservedPair {
    rig: StereoRig,
    disparity: [DisparityMap; 2],
    flow: [FlowField; 2],
    tracks: Vec<StereoTrack>,
    interval_s: f64,
}

impl ObservedPair {
    /// Observe a pair, with disparity from the images or from the truth.
    ///
    /// # Errors
    /// [`ObservingError`], which rendered images do not give.
    pub(super) fn new(
        pair: &RandomPair<'_>,
        rig: &StereoRig,
        interval_s: f64,
        source: DisparitySource,
    ) -> Result<Self, ObservingError> {
        let config = Config::default();
        let frames = [pair.frame(0), pair.frame(1)];
        let pyramids = frames
            .each_ref()
            .map(|frame| StereoPyramid::new(&frame.left, &frame.right, config.tracks.pyramid_levels));
        let tracks = stereo_tracks(&pyramids[0], &pyramids[1], rig, Hints::default(), &config.tracks);
        let disparity = match source {
            DisparitySource::Matched => matched(&frames)?,
            DisparitySource::Exact => [exact(pair, 0), exact(pair, 1)],
        };
        let start =
            motion_of(&tracks, rig, interval_s, None).map_or_else(|_| Twist::zero(), |m| m.phi_or_zero());
        let flow = |side: Side| {
            let predicted = rigid_flow(&disparity[0], rig, &start, side);
            let [from, to] = match side {
                Side::Left => [&pyramids[0].left, &pyramids[1].left],
                Side::Right => [&pyramids[0].right, &pyramids[1].right],
            };
            dense_flow(from, to, Some(&predicted), &config.flow)
        };
        let flow = [flow(Side::Left)?, flow(Side::Right)?];
        Ok(Self { rig: *rig, disparity, flow, tracks, interval_s })
    }

    /// The answer of tracked corners, by maximum likelihood.
    ///
    /// # Errors
    /// [`Unsolvable`] when they do not determine a motion.
    pub(super) fn by_corners(&self) -> Result<MotionEstimate, Unsolvable> {
        motion_of(&self.tracks, &self.rig, self.interval_s, None)
    }

    /// The answer by the configured method.
    ///
    /// # Errors
    /// [`Unsolvable`] when the observations do not determine a motion.
    pub(super) fn solve(&self, config: &Config, start: Option<&Twist>) -> Result<MotionEstimate, Unsolvable> {
        let interval = self.interval(config);
        Ok(solve(&self.observed(&interval), &interval, start)?.with_exact_rig())
    }

    /// Where corners contradict an answer.
    pub(super) fn contradiction(
        &self,
        config: &Config,
        found: &MotionEstimate,
        corners: &MotionEstimate,
    ) -> Option<Contradiction> {
        let interval = self.interval(config);
        contradiction(found, corners, &self.observed(&interval), &interval)
    }

    fn interval<'a>(&'a self, config: &'a Config) -> Interval<'a> {
        Interval::new(&self.rig, config, TrackSource::Stereo, self.interval_s)
    }

    fn observed(&self, interval: &Interval<'_>) -> Observed<'_> {
        let pair = DensePair {
            rig: &self.rig,
            before: &self.disparity[0],
            after: &self.disparity[1],
            flow: &self.flow[0],
            flow_right: interval.plan.right_flow.then_some(&self.flow[1]),
            external_disparity: false,
        };
        Observed::Fields(pair, &self.tracks)
    }
}

fn motion_of(
    tracks: &[StereoTrack],
    rig: &StereoRig,
    interval_s: f64,
    start: Option<&Twist>,
) -> Result<MotionEstimate, Unsolvable> {
    let config = Config::default();
    let interval = Interval::new(rig, &config, TrackSource::Stereo, interval_s);
    Ok(solve(&Observed::Tracks(tracks), &interval, start)?.with_exact_rig())
}

fn matched(frames: &[StereoFrame; 2]) -> Result<[DisparityMap; 2], DisparityError> {
    let mut matcher = DisparityMatcher::new(Config::default().disparity);
    let mut map = |frame: &StereoFrame| matcher.compute(&frame.left, &frame.right);
    Ok([map(&frames[0])?, map(&frames[1])?])
}

/// The true disparity, where both cameras see the point.
fn exact(pair: &RandomPair<'_>, k: usize) -> DisparityMap {
    let shift = pair.view(k).truth_maps(None).shift;
    DisparityMap::given(shift, |_| STATED_SIGMA_PX)
}
