//! What every pixel would do as part of the still world, with what a wrong calibration adds to its uncertainty.

use crate::estimate::MotionEstimate;
use crate::estimate::systematic_response;
use crate::motion::{DisparityOffset, RigidPrediction};
use crate::observe::StereoTrack;
use crate::pipeline::plan::Interval;

/// Standard deviation of an offset of disparity, in pixels, for each pixel by which matches of left and right lie on
/// different rows.
///
/// Rows show only the vertical part of a wrong calibration; yaw, focal lengths and distortion act along rows as well.
/// On the four KITTI scenes with laser truth the horizontal offset is 0.6 to 3.1 times the vertical one; this is the
/// cautious end.
const OFFSET_PER_ROW_DISAGREEMENT: f64 = 3.0;

/// What every pixel would do as part of the still world; `None` without a motion.
///
/// How φ answers to a wrong calibration is taken from maximum likelihood on the tracks, whatever the method that found
/// φ.
pub(super) fn still_world<'a>(
    tracks: &[StereoTrack],
    motion: Option<&MotionEstimate>,
    row_disagreement_px: Option<f64>,
    interval: &Interval<'a>,
) -> Option<RigidPrediction<'a>> {
    let motion = motion?;
    let kernel = &interval.config.maximum_likelihood.kernel;
    let systematic = systematic_response(tracks, interval.rig, &motion.phi_or_zero(), kernel);
    let offset = systematic.map_or_else(DisparityOffset::none, |systematic| DisparityOffset {
        sigma_px: OFFSET_PER_ROW_DISAGREEMENT * row_disagreement_px.unwrap_or(0.0),
        phi_per_px: systematic.phi_per_offset_px,
    });
    RigidPrediction::new(&motion.theta, offset, interval.rig)
}
