//! What a motion means: VZ and time to impact of every pixel, what moves by itself, and the nearest obstacle.

mod groups;
mod map_row;
mod maps;
mod moving;
mod still_world;

pub use groups::MovingGroup;
pub use maps::{MotionMaps, motion_maps};

use groups::Groups;
use maps::track_sightings;
use moving::Moving;
use still_world::{body, still_world};

use super::plan::Interval;
use super::solve::PairMotion;
use crate::motion::{NoObstacle, Obstacle, ObstacleCriteria, nearest_obstacle};
use crate::observe::{DensePair, StereoPyramid, StereoTrack};

/// What a motion means for every pixel.
pub(super) struct Meaning {
    pub(super) maps: MotionMaps,
    pub(super) moving: Vec<MovingGroup>,
    pub(super) obstacle: Result<Obstacle, NoObstacle>,
}

/// The nearest obstacle that tracks show.
pub(super) fn tracks(
    tracks: &[StereoTrack],
    motion: Option<&PairMotion>,
    interval: &Interval<'_>,
) -> Result<Obstacle, NoObstacle> {
    let still = motion.and_then(|motion| still_world(motion, interval)).ok_or(NoObstacle::NothingMeasured)?;
    let mut seen = track_sightings(tracks, &still, interval);
    nearest_obstacle(&mut seen, (interval.rig.width_px, interval.rig.height_px), &ObstacleCriteria::SPARSE)
}

/// What a motion means for the pixels of dense fields.
pub(super) fn fields(
    pair: &DensePair<'_>,
    images: (&StereoPyramid, &StereoPyramid),
    motion: Option<&PairMotion>,
    interval: &Interval<'_>,
) -> Meaning {
    let still = motion.and_then(|motion| still_world(motion, interval));
    let groups = still.as_ref().zip(motion).map(|(still, motion)| {
        let moving = Moving::find(pair, images, still);
        let predict = |tracks: &[_], own: &_| body(tracks, own, &motion.rig_sigma, interval);
        Groups::find(pair, moving, interval, &motion.with_exact_rig(), predict)
    });
    let (maps, mut seen) = motion_maps(pair, still.as_ref(), groups.as_ref(), interval);
    // Without a motion nobody knows what will be in the vehicle's way.
    let obstacle = still
        .ok_or(NoObstacle::NothingMeasured)
        .and_then(|_| nearest_obstacle(&mut seen, pair.flow.size(), &ObstacleCriteria::DENSE));
    Meaning { maps, moving: groups.map_or_else(Vec::new, Groups::into_groups), obstacle }
}
