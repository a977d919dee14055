//! From tracks to motion and to what it means for them, whoever found the tracks.

use super::config::Config;
use super::contested::scene_motion;
use super::frame_pair::{PairResult, timed};
use super::maps::track_sightings;
use super::solve::{Observed, solve};
use super::stereo::StageTimes;
use super::unanswered::Unanswered;
use crate::estimate::{
    MaximumLikelihoodOptions, MotionEstimate, TrackSource, Unsolvable, maximum_likelihood, robust_start,
    systematic_response,
};
use crate::geometry::{StereoRig, Twist};
use crate::motion::{DisparityOffset, NoObstacle, ObstacleCriteria, RigidPrediction, nearest_obstacle};
use crate::observe::StereoTrack;

/// Standard deviation of an offset of disparity per pixel by which rows disagree.
///
/// Rows show only the vertical part of a wrong calibration; yaw, focal lengths and distortion act
/// along rows as well. On the four KITTI scenes with laser truth the horizontal offset is 0.6 to 3.1
/// times the vertical one; this is the cautious end.
const OFFSET_PER_ROW_DISAGREEMENT: f64 = 3.0;

/// What tracks of an interval are solved with.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrackSolver<'a> {
    pub(super) rig: &'a StereoRig,
    pub(super) config: &'a Config,
    pub(super) dt_s: f64,
    /// What makes the tracks.
    pub(super) source: TrackSource,
}

impl<'a> TrackSolver<'a> {
    /// The motion of most tracks, or of those that go on as before where a body holds most.
    pub(super) fn rough(&self, tracks: &[StereoTrack], prior: Option<&Twist>) -> Result<Twist, Unsolvable> {
        let own = &self.config.maximum_likelihood;
        let options = &MaximumLikelihoodOptions { seed: own.seed ^ self.config.seed, ..*own };
        let of_most = |tracks: &[StereoTrack]| {
            let start = robust_start(tracks, self.rig, prior, options)?;
            self.refined(tracks, &start)
        };
        let found = of_most(tracks)?;
        Ok(prior.map_or(found, |prior| scene_motion(tracks, self.rig, found, prior, of_most)))
    }

    pub(super) fn refined(&self, tracks: &[StereoTrack], start: &Twist) -> Result<Twist, Unsolvable> {
        let kernel = &self.config.maximum_likelihood.kernel;
        Ok(maximum_likelihood(tracks, self.rig, start, None, kernel)?.motion.phi())
    }

    /// The answer of tracks alone, whose left and right places disagree by so many rows.
    pub(super) fn sparse(
        &self,
        tracks: &[StereoTrack],
        rough: Result<Twist, Unsolvable>,
        row_disagreement_px: Option<f64>,
        stages: &mut StageTimes,
    ) -> PairResult {
        let motion = timed(&mut stages.estimate_ms, || {
            solve(&Observed::Sparse(tracks, self.source), self.rig, &rough?, self.config, self.dt_s)
        });
        let rigid = self.rigid(tracks, motion.as_ref().ok(), row_disagreement_px);
        let obstacle = rigid.ok_or(NoObstacle::NothingMeasured).and_then(|rigid| {
            let mut seen = track_sightings(tracks, &rigid, self.rig, self.config, self.dt_s);
            nearest_obstacle(&mut seen, (self.rig.width_px, self.rig.height_px), &ObstacleCriteria::SPARSE)
        });
        PairResult {
            motion: motion.map_err(Unanswered::from),
            row_disagreement_px,
            obstacle,
            moving: Vec::new(),
            flow: None,
            maps: None,
            corners: Vec::new(),
        }
    }

    /// What every pixel would do as part of the still world.
    ///
    /// How φ answers to a wrong calibration is taken from maximum likelihood on the tracks, whatever
    /// the method that found φ.
    pub(super) fn rigid(
        &self,
        tracks: &[StereoTrack],
        motion: Option<&MotionEstimate>,
        row_disagreement_px: Option<f64>,
    ) -> Option<RigidPrediction<'a>> {
        let motion = motion?;
        let kernel = &self.config.maximum_likelihood.kernel;
        let systematic = systematic_response(tracks, self.rig, &motion.phi(), kernel);
        let offset = systematic.map_or_else(DisparityOffset::none, |systematic| DisparityOffset {
            sigma_px: OFFSET_PER_ROW_DISAGREEMENT * row_disagreement_px.unwrap_or(0.0),
            phi_per_px: systematic.phi_per_offset_px,
        });
        RigidPrediction::new(&motion.theta, offset, self.rig)
    }
}
