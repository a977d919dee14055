//! Two frames compared: the paper's list of sections as one way from images to what their motion means.

use std::time::Instant;

use super::config::{Approach, Config, Method, Observe};
use super::groups::{Groups, MovingGroup};
use super::maps::{MotionMaps, motion_maps};
use super::moving::Moving;
use super::shape::solve_with_shape;
use super::solve::{Observed, solve};
use super::stereo::StageTimes;
use super::track_solver::TrackSolver;
use super::unanswered::Unanswered;
use crate::estimate::sensor::tolerance::TrackSource;
use crate::estimate::{MotionEstimate, Unsolvable};
use crate::geometry::{Grid, StereoRig, Twist};
use crate::motion::obstacle::{NoObstacle, Obstacle, ObstacleCriteria, nearest};
use crate::observe::flow::{FlowPair, FlowSpace, Side, rigid_flow};
use crate::observe::tracks::{
    Hints, SearchStart, StereoCorner, Trace, follow, stereo_corners, tracks_from_traces,
};
use crate::observe::{
    DensePair, DisparityMap, FlowField, FlowOptions, StereoPyramid, StereoTrack, row_disagreement,
};

/// A frame that later ones are matched with.
#[derive(Debug)]
pub(super) struct Reference {
    pub(super) frame: usize,
    pub(super) time_s: f64,
    pub(super) images: StereoPyramid,
    pub(super) disparity: Option<DisparityMap>,
    /// Given flow to the next frame.
    pub(super) flow: Option<FlowField>,
    /// Corners that were followed here from the frame before.
    pub(super) corners: Vec<StereoCorner>,
}

/// Two frames to be compared.
pub(super) struct FramePair<'a> {
    pub(super) before: &'a Reference,
    pub(super) after: &'a Reference,
    pub(super) rig: &'a StereoRig,
    pub(super) config: &'a Config,
    /// Pixels of the left and of the right image never to use.
    pub(super) masks: [Option<&'a Grid<bool>>; 2],
}

pub(super) struct PairResult {
    pub(super) motion: Result<MotionEstimate, Unanswered>,
    pub(super) row_disagreement_px: Option<f64>,
    pub(super) obstacle: Result<Obstacle, NoObstacle>,
    pub(super) moving: Vec<MovingGroup>,
    pub(super) flow: Option<FlowField>,
    pub(super) maps: Option<MotionMaps>,
    /// The corners that were followed, in the later frame.
    pub(super) corners: Vec<StereoCorner>,
}

/// What following corners gave.
struct Tracked {
    tracks: Vec<StereoTrack>,
    rough: Result<Twist, Unsolvable>,
    corners: Vec<StereoCorner>,
}

/// About so many corners find the motion that guides the others.
const SCOUTS: usize = 250;
/// The level from which scouts are searched around their predicted place: a window there spans 44 pixels.
const PRIOR_LEVEL: usize = 2;

impl FramePair<'_> {
    pub(super) fn dt_s(&self) -> f64 {
        self.after.time_s - self.before.time_s
    }

    /// Observe, constrain and estimate; then what the motion means for every pixel.
    pub(super) fn motion(
        &self,
        velocity: Option<&Twist>,
        space: &mut FlowSpace,
        stages: &mut StageTimes,
    ) -> PairResult {
        let prior = velocity.map(|v| v.scaled(self.dt_s()));
        let Tracked { tracks, rough, corners } = timed(&mut stages.tracks_ms, || self.tracks(prior.as_ref()));
        let result = match self.config.observe {
            Observe::Sparse => {
                let rows = row_disagreement(&self.before.images, &tracks, self.rig);
                self.solver().sparse(&tracks, rough, rows, stages)
            }
            Observe::Dense => {
                let refined = timed(&mut stages.tracks_ms, || {
                    rough.and_then(|rough| self.solver().refined(&tracks, &rough))
                });
                self.dense(&tracks, refined, space, stages)
            }
        };
        PairResult { corners, ..result }
    }

    /// The corners of both frames: a few scouts find the motion that guides all of them.
    fn tracks(&self, prior: Option<&Twist>) -> Tracked {
        let images = &self.before.images;
        let kept = &self.before.corners;
        let corners = stereo_corners(images, kept, self.rig, self.hints(None), &self.config.tracks);
        let step = corners.len().div_ceil(SCOUTS).max(1);
        let scouts: Vec<StereoCorner> = corners.iter().step_by(step).copied().collect();
        let mut found = match prior {
            Some(_) => self.follow(&scouts, prior, SearchStart::Level(PRIOR_LEVEL)),
            None => Vec::new(),
        };
        // A wrong prior loses most corners; then searching without it finds more.
        if 2 * found.len() < scouts.len() {
            let free = self.follow(&scouts, None, SearchStart::Level(usize::MAX));
            if free.len() > found.len() {
                found = free;
            }
        }
        let rough = self.solver().rough(&tracks_from_traces(&found, self.rig), prior);
        let traces = match &rough {
            Ok(rough) => self.follow(&corners, Some(rough), SearchStart::FullResolution),
            Err(_) => Vec::new(),
        };
        Tracked {
            tracks: tracks_from_traces(&traces, self.rig),
            rough,
            corners: traces.iter().map(|trace| trace.after).collect(),
        }
    }

    fn follow(&self, corners: &[StereoCorner], motion: Option<&Twist>, start: SearchStart) -> Vec<Trace> {
        let images = (&self.before.images, &self.after.images);
        follow(images.0, images.1, corners, self.rig, self.hints(motion), start, &self.config.tracks)
    }

    fn hints<'b>(&'b self, motion: Option<&'b Twist>) -> Hints<'b> {
        let shift = self.before.disparity.as_ref().map(|d| &d.shift);
        let maps = self.before.disparity.as_ref().zip(self.after.disparity.as_ref());
        let both_right = self.before.images.has_right() && self.after.images.has_right();
        let external_disparity = maps.filter(|_| !both_right).map(|(before, after)| [before, after]);
        Hints { shift, motion, mask: self.masks[0], mask_right: self.masks[1], external_disparity }
    }

    fn solver(&self) -> TrackSolver<'_> {
        let source = if self.hints(None).external_disparity.is_some() {
            TrackSource::Image
        } else {
            TrackSource::Stereo
        };
        TrackSolver { rig: self.rig, config: self.config, dt_s: self.dt_s(), source }
    }

    fn dense(
        &self,
        tracks: &[StereoTrack],
        rough: Result<Twist, Unsolvable>,
        space: &mut FlowSpace,
        stages: &mut StageTimes,
    ) -> PairResult {
        let nothing = |why| PairResult {
            motion: Err(why),
            row_disagreement_px: None,
            obstacle: Err(NoObstacle::NothingMeasured),
            moving: Vec::new(),
            flow: None,
            maps: None,
            corners: Vec::new(),
        };
        let (Some(before), Some(after)) = (&self.before.disparity, &self.after.disparity) else {
            return nothing(Unanswered::Unsolvable(Unsolvable::FewRows { rows: 0, needed: 6 }));
        };
        let differential = self.config.approach == Approach::Differential;
        let both = differential && matches!(self.config.method, Method::Dv | Method::Joint | Method::Ml);
        let prediction = rough.as_ref().ok();
        let given = self.before.flow.as_ref().filter(|_| self.after.frame == self.before.frame + 1);
        let (flow, right) = timed(&mut stages.flow_ms, || {
            let left = match given {
                Some(given) => Some(given.clone()),
                None => self.flow(Side::Left, before, prediction, space),
            };
            let both = both && self.before.images.has_right() && self.after.images.has_right();
            let right = both.then(|| self.flow(Side::Right, before, prediction, space));
            (left, right.flatten())
        });
        let Some(flow) = flow else {
            return nothing(Unanswered::Unsolvable(Unsolvable::FewRows { rows: 0, needed: 6 }));
        };
        let shaped = self.hints(None).external_disparity.is_some();
        let pair = DensePair {
            rig: self.rig,
            before,
            after,
            flow: &flow,
            flow_right: right.as_ref(),
            external_disparity: shaped,
        };
        let by_shape =
            shaped && (self.config.method, self.config.approach) == (Method::Ml, Approach::Discrete);
        let motion = timed(&mut stages.estimate_ms, || {
            if by_shape {
                return solve_with_shape(&pair, tracks, rough.as_ref().ok(), self.config, self.dt_s())?
                    .known();
            }
            let start = rough.unwrap_or_else(|_| Twist::zero());
            solve(&Observed::Dense(pair, tracks), self.rig, &start, self.config, self.dt_s())
        });
        let rows = row_disagreement(&self.before.images, tracks, self.rig);
        let (maps, obstacle, moving) = timed(&mut stages.maps_ms, || {
            let rigid = self.solver().rigid(tracks, motion.as_ref().ok(), rows);
            let groups = rigid.as_ref().zip(motion.as_ref().ok()).map(|(rigid, still)| {
                let moving = Moving::find(&pair, (&self.before.images, &self.after.images), rigid);
                let predict = |tracks: &[_], motion: &_| self.solver().rigid(tracks, Some(motion), rows);
                Groups::find(&pair, moving, self.config, still, self.dt_s(), predict)
            });
            let (maps, mut seen) =
                motion_maps(&pair, rigid.as_ref(), groups.as_ref(), self.config, self.dt_s());
            // Without a motion nobody knows what will cross the window.
            let obstacle = rigid
                .ok_or(NoObstacle::NothingMeasured)
                .and_then(|_| nearest(&mut seen, pair.flow.size(), &ObstacleCriteria::DENSE));
            (maps, obstacle, groups.map_or_else(Vec::new, Groups::into_groups))
        });
        PairResult {
            motion: motion.map_err(Unanswered::from),
            row_disagreement_px: rows,
            obstacle,
            moving,
            maps: Some(maps),
            flow: Some(flow),
            corners: Vec::new(),
        }
    }

    /// Flow of one camera; what is not measured but predicted counts for the left one only, for the right
    /// one's is read between its pixels.
    fn flow(
        &self,
        side: Side,
        before: &DisparityMap,
        phi: Option<&Twist>,
        space: &mut FlowSpace,
    ) -> Option<FlowField> {
        let (a, b) = (&self.before.images, &self.after.images);
        let (from, to, spline) = match side {
            Side::Left => (&a.left, &b.left, &b.left_spline),
            Side::Right => (&a.right, &b.right, &b.right_spline),
        };
        let initial = phi.map(|phi| rigid_flow(before, self.rig, phi, side));
        let fill = self.config.flow.fill && side == Side::Left;
        let options = FlowOptions { fill, ..self.config.flow.clone() };
        FlowPair { from, to, to_spline: Some(spline) }.flow(initial.as_ref(), &options, space).ok()
    }
}

/// Run a stage and add its time.
pub(super) fn timed<T>(total_ms: &mut f64, run: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let value = run();
    *total_ms += start.elapsed().as_secs_f64() * 1e3;
    value
}
