//! A first motion from tracks alone: it guides what is observed next, and the estimate begins with it.

use super::scene_motion::scene_motion;
use crate::estimate::maximum_likelihood;
use crate::estimate::robust_start;
use crate::estimate::{MotionEstimate, Unsolvable};
use crate::geometry::Twist;
use crate::observe::StereoTrack;
use crate::pipeline::plan::Interval;

/// The motion of most tracks, or of those that go on as `expected` where a body holds most.
///
/// # Errors
/// [`Unsolvable`] when the tracks do not determine a motion.
pub(in crate::pipeline) fn first_motion(
    tracks: &[StereoTrack],
    interval: &Interval<'_>,
    expected: Option<&Twist>,
) -> Result<Twist, Unsolvable> {
    let options = &interval.config.seeded_likelihood();
    let of_most = |tracks: &[StereoTrack]| {
        let start = robust_start(tracks, interval.rig, expected, options)?;
        Ok(refined_motion(tracks, interval, &start)?.phi_or_zero())
    };
    let found = of_most(tracks)?;
    let goes_on = |expected| scene_motion(tracks, interval.rig, found, expected, of_most);
    Ok(expected.map_or(found, goes_on))
}

/// The most likely motion near `start`.
///
/// # Errors
/// [`Unsolvable`] when the tracks do not determine a motion.
pub(in crate::pipeline) fn refined_motion(
    tracks: &[StereoTrack],
    interval: &Interval<'_>,
    start: &Twist,
) -> Result<MotionEstimate, Unsolvable> {
    let kernel = &interval.config.maximum_likelihood.kernel;
    Ok(maximum_likelihood(tracks, interval.rig, start, None, kernel)?.motion)
}
