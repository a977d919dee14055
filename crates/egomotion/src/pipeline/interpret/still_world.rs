//! What every pixel would do as part of a rigid world, with what the rig's errors add to its uncertainty.

use crate::estimate::{MotionEstimate, systematic_response};
use crate::geometry::RigErrors;
use crate::motion::{RigUncertainty, RigidPrediction};
use crate::observe::StereoTrack;
use crate::pipeline::plan::Interval;
use crate::pipeline::solve::PairMotion;

/// What every pixel would do as part of the still world; `None` where some component of its motion is unknown.
pub(super) fn still_world<'a>(motion: &PairMotion, interval: &Interval<'a>) -> Option<RigidPrediction<'a>> {
    let uncertainty =
        RigUncertainty { sigma: motion.rig_sigma, phi_per_error: motion.parts.phi_per_rig_error };
    RigidPrediction::new(&motion.with_exact_rig().theta, &uncertainty, interval.rig)
}

/// What the pixels of a body with these tracks would do by its motion, whose covariance is without the rig's errors.
pub(super) fn body<'a>(
    tracks: &[StereoTrack],
    motion: &MotionEstimate,
    rig_sigma: &RigErrors,
    interval: &Interval<'a>,
) -> Option<RigidPrediction<'a>> {
    let kernel = &interval.config.maximum_likelihood.kernel;
    let systematic = systematic_response(tracks, interval.rig, &motion.phi_or_zero(), kernel);
    let uncertainty = systematic.map_or_else(RigUncertainty::none, |systematic| RigUncertainty {
        sigma: *rig_sigma,
        phi_per_error: systematic.phi_per_rig_error,
    });
    RigidPrediction::new(&motion.theta, &uncertainty, interval.rig)
}
