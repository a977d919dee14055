//! Systematic errors: those that all observations of a frame share, which no number of observations averages out.
//!
//! Two are named: a *phase error*, by which interpolation and noise shift every match by an amount that
//! depends on the fraction of a pixel of its displacement, like a sine, and an unknown *offset of disparity*,
//! by which the rig's calibration is wrong. Where all points move alike the phase error is common to all;
//! where displacements differ by pixels it averages out. The effect of either on φ̂ follows from the normal
//! equations: δφ = A⁻¹ Σ Gᵀ S⁻¹ δe.

use nalgebra::{Matrix6, SMatrix, Vector3, Vector6};

use super::mixture::ResidualModel;
use super::score_sums::{FrameSums, LikelihoodTerm, ScoreSums, Weighing, squares};
use crate::constrain::LinearisationPoint;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::student_t::StudentT;
use crate::geometry::{StereoRig, Twist};

/// How φ̂ answers to systematic errors, those that all observations of a frame share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SystematicResponse {
    /// φ̂ per pixel of the phase error's amplitude in x, in y and in disparity (of flows, the right camera's x), 6×3.
    pub phi_per_phase_px: SMatrix<f64, 6, 3>,
    /// φ̂ per pixel by which every disparity is too large, before and after.
    pub phi_per_offset_px: Vector6<f64>,
}

impl SystematicResponse {
    /// δφ = A⁻¹ Σ Gᵀ S⁻¹ δe; `None` where some direction is not determined.
    pub(crate) fn of(sums: &ScoreSums) -> Option<Self> {
        let information = &sums.score.information;
        let observability = Observability::of(information).ok()?;
        let complete = observability.observed::<6>().iter().all(|&o| o);
        let solved = information.cholesky()?.solve(&sums.systematic);
        complete.then(|| Self {
            phi_per_phase_px: solved.fixed_view::<6, 3>(0, 0).into(),
            phi_per_offset_px: solved.fixed_view::<6, 1>(0, 3).into(),
        })
    }

    /// Covariance of φ that a phase error adds whose three amplitudes have the standard deviation `sigma_px`.
    pub(crate) fn phase_covariance(&self, sigma_px: f64) -> Matrix6<f64> {
        sigma_px * sigma_px * self.phi_per_phase_px * self.phi_per_phase_px.transpose()
    }
}

/// The response of the maximum-likelihood estimate at φ, with the structure as measured; `None` where some direction is not determined.
pub fn systematic_response<M: LikelihoodTerm>(
    observations: &[M],
    rig: &StereoRig,
    phi: &Twist,
    kernel: &StudentT,
) -> Option<SystematicResponse> {
    let at = LinearisationPoint::new(*phi, rig);
    let residuals = ResidualModel::of(kernel, &mut squares(observations, &at))?;
    let mut structures: Vec<Vector3<f64>> = observations.iter().map(M::structure).collect();
    let weighing = Weighing { blocks: None, residuals };
    SystematicResponse::of(&FrameSums::linearised(observations, &mut structures, &at, &weighing).whole)
}
