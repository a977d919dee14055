//! What was observed of a pair of frames, as the observations that each method takes.

use crate::observe::{DensePair, DepthChange, GradientStencil, StereoFlow, StereoTrack};
use crate::pipeline::config::Approach;
use crate::pipeline::plan::Interval;

/// Where the observations of a pair of frames come from.
#[derive(Debug, Clone, Copy)]
pub enum Observed<'a> {
    /// Tracked corners.
    Tracks(&'a [StereoTrack]),
    /// Dense fields, of which every `sample_step_px`-th pixel is used, and the corners that were tracked besides.
    Fields(DensePair<'a>, &'a [StereoTrack]),
}

impl Observed<'_> {
    /// Points before and after.
    pub(super) fn tracks(&self, interval: &Interval<'_>) -> Vec<StereoTrack> {
        match self {
            Observed::Tracks(tracks) => tracks.to_vec(),
            Observed::Fields(pair, tracks) => {
                let mut all = pair.every(interval.config.sample_step_px, DensePair::stereo_track);
                all.extend_from_slice(tracks);
                all
            }
        }
    }

    /// Velocities at the middle of the interval.
    pub(super) fn flows(&self, interval: &Interval<'_>) -> Vec<StereoFlow> {
        match self {
            Observed::Fields(pair, _) => pair.every(interval.config.sample_step_px, DensePair::stereo_flow),
            Observed::Tracks(tracks) => tracks.iter().map(StereoTrack::midpoint_flow).collect(),
        }
    }

    /// Changes of depth; tracks have none.
    pub(super) fn depth_changes(&self, interval: &Interval<'_>) -> Vec<DepthChange> {
        let bf = interval.rig.depth_disparity_product();
        let step = interval.config.sample_step_px;
        match (self, interval.plan.approach) {
            (Observed::Tracks(_), _) => Vec::new(),
            (Observed::Fields(pair, _), Approach::Discrete) => pair.every(step, |pair, u, v| {
                Some(pair.depth_track(u, v, GradientStencil::Plane)?.depth_change(bf))
            }),
            (Observed::Fields(pair, _), Approach::Differential) => pair.every(step, |pair, u, v| {
                Some(pair.depth_flow(u, v, GradientStencil::Plane)?.depth_change(bf))
            }),
        }
    }
}
