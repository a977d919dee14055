//! Systematic errors: those that all observations of a frame share, which no number of observations averages out.
//!
//! Three kinds are known: a *phase error*, by which interpolation and noise shift every match by an amount that
//! depends on the fraction of a pixel of its displacement, like a sine; a *field error*, an offset of all matches in a block of the image, which its geometry causes and not its
//! noise; and the *errors of the rig* ([`RigErrors`](crate::geometry::RigErrors)).
//! Where all points move alike the phase error is common to all; where displacements differ by pixels it averages out.
//! The effect of each on φ̂ follows from the normal equations: δφ = A⁻¹ Σ w Gᵀ S⁻¹ δe.

use std::collections::BTreeMap;

use nalgebra::{Matrix6, SMatrix};
use rayon::prelude::*;

use super::mixture::ResidualModel;
use super::score_sums::squares;
use crate::constrain::{LinearisationPoint, Measurement};
use crate::estimate::certainty::blocks::Blocks;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::student_t::StudentT;
use crate::geometry::gaussian::product;
use crate::geometry::{RIG_ERRORS, StereoRig, Twist};

/// About this many observations tell the response: it is a mean over them, which more would change by a percent.
const OBSERVATIONS: usize = 2048;
/// Observations handled by one task; fixed, so that sums do not depend on the number of threads.
const STRIP: usize = 256;

/// How φ̂ answers to systematic errors, those that all observations of a frame share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SystematicResponse {
    /// φ̂ per pixel of the phase error's amplitude in x, in y and in disparity (of flows, the right camera's x), 6×3.
    pub phi_per_phase_px: SMatrix<f64, 6, 3>,
    /// φ̂ per pixel of the field error's standard deviation, 6×6: L of L Lᵀ, its covariance per square pixel. A field that
    /// stays the same moves φ̂ of pairs with the same geometry alike.
    pub phi_per_field_px: Matrix6<f64>,
    /// φ̂ per unit of each of [`RigErrors`](crate::geometry::RigErrors), 6×8.
    pub phi_per_rig_error: SMatrix<f64, 6, RIG_ERRORS>,
}

/// Sums over observations, by their small motion.
#[derive(Clone, Default)]
struct SharedSums {
    information: Matrix6<f64>,
    phase: SMatrix<f64, 6, 3>,
    rig: SMatrix<f64, 6, RIG_ERRORS>,
    /// Of each block.
    field: BTreeMap<usize, SMatrix<f64, 6, 3>>,
}

impl SharedSums {
    fn add<M: Measurement>(
        &mut self,
        observation: &M,
        at: &LinearisationPoint<'_>,
        residuals: &ResidualModel,
        blocks: Option<&Blocks>,
    ) {
        // Once to move the structure to where it settles.
        let mut structure = observation.structure();
        let _measured = observation.linearise(&mut structure, at);
        let settled = structure;
        let (Some(l), Some(shared)) =
            (observation.linearise(&mut structure, at), observation.shared_jacobian(&settled, at))
        else {
            return;
        };
        let q = l.e.dot(&product(&l.inverse_cov, &l.e));
        let (weight, _) = residuals.mixture.weight(q / residuals.scale2);
        let weighted = product(&l.motion_jacobian.transpose(), &(l.inverse_cov * weight));
        self.information += product(&weighted, &l.motion_jacobian);
        self.phase += product(&weighted, &shared.phase);
        self.rig += product(&weighted, &shared.rig);
        if let Some(blocks) = blocks {
            let (x, y) = observation.position();
            *self.field.entry(blocks.index(x, y)).or_default() += weighted;
        }
    }

    fn merged(mut self, other: &Self) -> Self {
        for (block, sum) in &other.field {
            *self.field.entry(*block).or_default() += sum;
        }
        self.information += other.information;
        self.phase += other.phase;
        self.rig += other.rig;
        self
    }
}

impl SystematicResponse {
    /// δφ = A⁻¹ Σ w Gᵀ S⁻¹ δe about a motion, with residuals as they were weighed there; `None` where some direction is not
    /// determined.
    pub(crate) fn of<M: Measurement>(
        observations: &[M],
        at: &LinearisationPoint<'_>,
        residuals: &ResidualModel,
        blocks: Option<&Blocks>,
    ) -> Option<Self> {
        let stride = observations.len().div_ceil(OBSERVATIONS).max(1);
        let few: Vec<M> = observations.iter().step_by(stride).copied().collect();
        let of_strip = |strip: &[M]| {
            let mut sums = SharedSums::default();
            strip.iter().for_each(|observation| sums.add(observation, at, residuals, blocks));
            sums
        };
        let strips: Vec<SharedSums> = few.par_chunks(STRIP).map(of_strip).collect();
        let sums = strips.iter().fold(SharedSums::default(), SharedSums::merged);
        // By the small motion δ; φ follows by δ = J φ.
        let jacobian = M::small_motion_jacobian(at);
        let information = jacobian.transpose() * sums.information * jacobian;
        let observability = Observability::of(&information).ok()?;
        let complete = observability.observed::<6>().iter().all(|&o| o);
        let solve = information.cholesky().filter(|_| complete)?;
        let of_block = |sum: &SMatrix<f64, 6, 3>| solve.solve(&(jacobian.transpose() * sum));
        let field: Matrix6<f64> = sums.field.values().map(|sum| squared(&of_block(sum))).sum();
        Some(Self {
            phi_per_phase_px: solve.solve(&(jacobian.transpose() * sums.phase)),
            phi_per_field_px: field.cholesky().map_or_else(Matrix6::zeros, |factor| factor.l()),
            phi_per_rig_error: solve.solve(&(jacobian.transpose() * sums.rig)),
        })
    }
}

/// M Mᵀ.
fn squared(m: &SMatrix<f64, 6, 3>) -> Matrix6<f64> {
    m * m.transpose()
}

/// The response of the maximum-likelihood estimate at φ, but to the field error; `None` where some direction is not determined.
pub fn systematic_response<M: Measurement>(
    observations: &[M],
    rig: &StereoRig,
    phi: &Twist,
    kernel: &StudentT,
) -> Option<SystematicResponse> {
    let at = LinearisationPoint::new(*phi, rig);
    let residuals = ResidualModel::of(kernel, &mut squares(observations, &at))?;
    SystematicResponse::of(observations, &at, &residuals, None)
}
