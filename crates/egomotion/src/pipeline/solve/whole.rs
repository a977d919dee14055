//! The whole uncertainty of a motion: what is new in its pair, and what all pairs and neighbouring ones share.

use super::super::plan::Interval;
use crate::estimate::{
    CovarianceParts, Estimate, LastMotion, MotionEstimate, SolvedMotion, systematic_response,
};
use crate::geometry::{Gaussian, RigErrors};
use crate::observe::StereoTrack;

/// φ of a pair of frames, with the parts of its uncertainty.
#[derive(Debug, Clone)]
pub(in crate::pipeline) struct PairMotion {
    /// φ̂; its covariance is the whole of it.
    pub(in crate::pipeline) estimate: MotionEstimate,
    pub(in crate::pipeline) parts: CovarianceParts,
    /// Standard deviations of the rig's errors.
    pub(in crate::pipeline) rig_sigma: RigErrors,
}

impl PairMotion {
    /// φ̂ with the covariance of an exact rig.
    pub(in crate::pipeline) fn with_exact_rig(&self) -> MotionEstimate {
        Estimate { theta: Gaussian { cov: self.parts.of_images(), ..self.estimate.theta }, ..self.estimate }
    }
}

/// A motion with all of its uncertainty, and what the next pair needs of it.
///
/// An estimator that does not say how it answers to the rig's errors is taken to do so as maximum likelihood of the
/// `tracks` does. `last` is the motion of the pair before, if its later frame is this one's earlier one.
pub(in crate::pipeline) fn whole_motion(
    mut solved: SolvedMotion,
    tracks: &[StereoTrack],
    interval: &Interval<'_>,
    rig_sigma: &RigErrors,
    last: Option<&LastMotion>,
) -> (PairMotion, Option<LastMotion>) {
    if solved.phi_per_rig_error.is_none() && solved.motion.is_complete() {
        let kernel = &interval.config.maximum_likelihood.kernel;
        let phi = solved.motion.phi();
        let systematic = systematic_response(tracks, interval.rig, &phi, kernel);
        solved.phi_per_rig_error = systematic.map(|systematic| systematic.phi_per_rig_error);
    }
    let parts = solved.parts(last);
    let mut estimate = solved.motion;
    estimate.theta.cov = parts.of_images() + parts.of_rig(rig_sigma);
    (PairMotion { estimate, parts, rig_sigma: *rig_sigma }, solved.into_last())
}
