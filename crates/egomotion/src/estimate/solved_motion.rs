//! A motion and the parts of its covariance: what is new in its pair of frames, and what other pairs share with it.

use nalgebra::{Matrix6, SMatrix};
use serde::{Deserialize, Serialize};

use super::certainty::neighbours::{BlockInfluences, shared_covariance};
use super::motion_estimate::MotionEstimate;
use crate::geometry::{RIG_ERRORS, RigErrors};

/// Number of the systematic errors of matching.
pub const MATCHING_ERRORS: usize = 9;

/// The parts of the covariance of φ̂.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CovarianceParts {
    /// What is new in the pair: the noise of its two frames.
    pub own: Matrix6<f64>,
    /// Cov(φ̂ of the pair before, φ̂), 6×6: the noise of the frame that both have. Zero where there is none.
    pub with_previous: Matrix6<f64>,
    /// How φ̂ moves with the systematic errors of matching, 6×9, each by one standard deviation: the phase errors in x, y
    /// and disparity, and what the field error does to φ̂. All pairs share those errors. Zero where φ̂ is not complete.
    pub phi_per_matching_sigma: SMatrix<f64, 6, MATCHING_ERRORS>,
    /// ∂φ̂/∂(errors of the rig), 6×8: all pairs share those errors. Zero where φ̂ is not complete.
    pub phi_per_rig_error: SMatrix<f64, 6, RIG_ERRORS>,
}

impl CovarianceParts {
    /// The covariance without the errors of the rig: of the pair's noise and of matching.
    pub fn of_images(&self) -> Matrix6<f64> {
        self.own + self.phi_per_matching_sigma * self.phi_per_matching_sigma.transpose()
    }

    /// What independent errors of a rig add to the covariance, of the standard deviations `sigma`.
    pub fn of_rig(&self, sigma: &RigErrors) -> Matrix6<f64> {
        let by_sigma = self.phi_per_rig_error * SMatrix::from_diagonal(&sigma.vector());
        by_sigma * by_sigma.transpose()
    }
}

/// A motion, from which the parts of its covariance follow.
#[derive(Debug, Clone, PartialEq)]
pub struct SolvedMotion {
    /// φ̂; its covariance is what is new in the pair.
    pub motion: MotionEstimate,
    /// As [`CovarianceParts::phi_per_matching_sigma`].
    pub phi_per_matching_sigma: SMatrix<f64, 6, MATCHING_ERRORS>,
    /// As [`CovarianceParts::phi_per_rig_error`]; `None` where the estimator does not tell.
    pub phi_per_rig_error: Option<SMatrix<f64, 6, RIG_ERRORS>>,
    /// The influences of the blocks of the earlier and of the later frame; `None` where the estimator does not tell.
    pub(crate) influences: Option<[BlockInfluences; 2]>,
}

impl From<MotionEstimate> for SolvedMotion {
    fn from(motion: MotionEstimate) -> Self {
        Self { motion, phi_per_matching_sigma: SMatrix::zeros(), phi_per_rig_error: None, influences: None }
    }
}

/// What the next pair needs of a motion, to know what it shares with it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct LastMotion {
    own: Matrix6<f64>,
    /// Of the blocks of its later frame.
    influences: BlockInfluences,
}

impl SolvedMotion {
    /// φ̂ with the covariance of the pair's noise and of matching, that of an exact rig.
    pub fn with_exact_rig(&self) -> MotionEstimate {
        let mut motion = self.motion;
        motion.theta.cov = self.parts(None).of_images();
        motion
    }

    /// The parts of the covariance; `last` is the motion of the pair before, if its later frame is this one's earlier one.
    pub(crate) fn parts(&self, last: Option<&LastMotion>) -> CovarianceParts {
        let own = self.motion.theta.cov;
        let with_previous = last
            .zip(self.influences.as_ref())
            .map(|(last, [earlier, _])| shared_covariance(&last.influences, earlier, [&last.own, &own]));
        CovarianceParts {
            own,
            with_previous: with_previous.unwrap_or_else(Matrix6::zeros),
            phi_per_matching_sigma: self.phi_per_matching_sigma,
            phi_per_rig_error: self.phi_per_rig_error.unwrap_or_else(SMatrix::zeros),
        }
    }

    /// What the next pair needs.
    pub(crate) fn into_last(self) -> Option<LastMotion> {
        let [_, influences] = self.influences?;
        Some(LastMotion { own: self.motion.theta.cov, influences })
    }
}
