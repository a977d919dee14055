//! Corners followed through both pairs of images: a few find the motion that guides all of them.

use super::FramePair;
use crate::estimate::TrackSource;
use crate::estimate::Unsolvable;
use crate::geometry::Twist;
use crate::observe::StereoTrack;
use crate::observe::tracks::{
    Hints, SearchStart, StereoCorner, Trace, follow, stereo_corners, tracks_from_traces,
};
use crate::pipeline::plan::Interval;
use crate::pipeline::solve::first_motion;

/// About this many corners find the motion that guides the others. With more it takes longer; with fewer the motion is less certain.
const GUIDING_CORNERS: usize = 250;
/// The pyramid level from which guiding corners are searched around their predicted place: a window there spans 44
/// pixels of the image.
const PREDICTED_LEVEL: usize = 2;

/// What following corners gives.
pub(super) struct FollowedCorners {
    pub(super) tracks: Vec<StereoTrack>,
    /// The motion of most guiding corners.
    pub(super) motion: Result<Twist, Unsolvable>,
    /// The corners in the later frame.
    pub(super) later: Vec<StereoCorner>,
}

impl FramePair<'_> {
    /// Follow the corners of the earlier frame. `expected` is the motion if it goes on as it was.
    pub(super) fn follow_corners(&self, expected: Option<&Twist>) -> FollowedCorners {
        let (rig, options) = (self.interval.rig, &self.interval.config.tracks);
        let before = self.before;
        let corners = stereo_corners(&before.images, &before.corners, rig, self.hints(None), options);
        let motion = self.guiding_motion(&corners, expected);
        let traces = match &motion {
            Ok(motion) => self.follow(&corners, Some(motion), SearchStart::FullResolution),
            Err(_) => Vec::new(),
        };
        FollowedCorners {
            tracks: self.tracks(&traces),
            motion,
            later: traces.iter().map(|trace| trace.after).collect(),
        }
    }

    /// The motion by which a part of the corners is found again.
    fn guiding_motion(
        &self,
        corners: &[StereoCorner],
        expected: Option<&Twist>,
    ) -> Result<Twist, Unsolvable> {
        let step = corners.len().div_ceil(GUIDING_CORNERS).max(1);
        let guiding: Vec<StereoCorner> = corners.iter().step_by(step).copied().collect();
        let mut found = match expected {
            Some(_) => self.follow(&guiding, expected, SearchStart::Level(PREDICTED_LEVEL)),
            None => Vec::new(),
        };
        // A wrong expectation loses most corners; then searching without it finds more.
        if 2 * found.len() < guiding.len() {
            let free = self.follow(&guiding, None, SearchStart::Level(usize::MAX));
            if free.len() > found.len() {
                found = free;
            }
        }
        first_motion(&self.tracks(&found), &self.interval, expected)
    }

    /// Tracks without the known errors of the right camera.
    fn tracks(&self, traces: &[Trace]) -> Vec<StereoTrack> {
        let Interval { rig, config, plan, .. } = self.interval;
        let mut tracks = tracks_from_traces(traces, rig);
        let known = config.rig_errors.values();
        if plan.source == TrackSource::Stereo && !known.is_none() {
            tracks.iter_mut().for_each(|track| track.correct(&known, rig));
            // A point beyond the horizon is none.
            tracks.retain(|track| track.before.mean.z > 0.0 && track.after.mean.z > 0.0);
        }
        tracks
    }

    fn follow(&self, corners: &[StereoCorner], motion: Option<&Twist>, start: SearchStart) -> Vec<Trace> {
        let (before, after) = self.images();
        let (rig, options) = (self.interval.rig, &self.interval.config.tracks);
        follow(before, after, corners, rig, self.hints(motion), start, options)
    }

    fn hints<'b>(&'b self, motion: Option<&'b Twist>) -> Hints<'b> {
        let shift = self.before.disparity.as_ref().map(|d| &d.shift);
        let maps = self.before.disparity.as_ref().zip(self.after.disparity.as_ref());
        let of_depth = self.interval.plan.source == TrackSource::Image;
        let external_disparity = maps.filter(|_| of_depth).map(|(before, after)| [before, after]);
        Hints { shift, motion, mask: self.masks[0], mask_right: self.masks[1], external_disparity }
    }
}
