//! φ and the sensor's errors estimated together: one Gauss–Newton step, and the covariance of φ that includes them.
//!
//! The errors u, from their prior means in units of their prior standard deviations, join φ as unknowns: with Y = (G, X)
//! and the prior u ~ N(0, 1), (Σ w Yᵀ S⁻¹ Y + D diag(0, 1)) δ = Σ w Yᵀ S⁻¹ e − D (0, u). Observations near each other share their noise
//! and say less than their number; D, by how much the scatter of the blocks' scores exceeds what independent rows
//! would have, keeps them from overruling the prior (the adjustment of composite likelihoods). The covariance is the
//! sandwich of [`covariance`] with the errors eliminated from each block's score, and the prior's own part.

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};
use rayon::prelude::*;

use super::errors::{ERRORS, RIGHT_CAMERA, SHUTTER, SensedTrack, SensorErrors, TrackSource};
use super::tolerance::SensorPrior;
use crate::constrain::{LinearisationPoint, Measurement};
use crate::estimate::certainty::blocks::{BlockScore, Blocks};
use crate::estimate::certainty::covariance::covariance;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::likelihood::maximum_likelihood::MaximumLikelihood;
use crate::estimate::likelihood::mixture::ResidualModel;
use crate::geometry::gaussian::product;
use crate::geometry::{RIG_ERRORS, StereoRig};
use crate::observe::StereoTrack;

/// Number of all unknowns: φ and the errors.
const ALL: usize = 6 + ERRORS;
/// Observations handled by one task; fixed, so that sums do not depend on the number of threads.
const STRIP: usize = 512;

/// What one step towards the most likely motion and errors says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AugmentedStep {
    /// By how much φ moves.
    pub step: Vector6<f64>,
    /// The errors after the step.
    pub errors: SensorErrors,
    /// Covariance of φ with what the errors of this pair add, but not the calibration's, which other pairs share.
    pub cov: Matrix6<f64>,
    /// ∂φ̂/∂(errors of the calibration), 6×8: what the pair could not tell of them. Zero for those of which nothing is
    /// allowed for.
    pub phi_per_rig_error: SMatrix<f64, 6, RIG_ERRORS>,
}

/// Step from what was `found` of `observations` from which `errors` are taken already; `None` where some direction of
/// motion is not determined.
pub(crate) fn augmented_step(
    observations: &[SensedTrack],
    rig: &StereoRig,
    found: &MaximumLikelihood,
    errors: &SensorErrors,
    prior: &SensorPrior,
    blocks: &Blocks,
) -> Option<AugmentedStep> {
    let at = LinearisationPoint::new(found.motion.phi_or_zero(), rig);
    let sums = AugmentedSums::by_block(observations, &At { motion: at, errors }, blocks, &found.residuals);
    let by_block: Vec<AugmentedScore> = sums.iter().map(|sums| sums.score(&at, prior)).collect();
    let unit = prior.sigma.map(|sigma| if sigma > 0.0 { sigma.recip() } else { 0.0 });
    let solved = AugmentedSolution::of(&by_block, &(errors.vector() - prior.mean).component_mul(&unit))?;
    let moved = errors.vector() + solved.step.fixed_rows::<ERRORS>(6).component_mul(&prior.sigma);
    Some(AugmentedStep {
        step: solved.step.fixed_rows::<6>(0).into(),
        errors: SensorErrors::from_vector(&moved),
        cov: solved.covariance(&by_block)?,
        phi_per_rig_error: solved.phi_per_rig_error(&unit),
    })
}

/// The motion and the errors about which observations are linearised.
struct At<'a> {
    motion: LinearisationPoint<'a>,
    errors: &'a SensorErrors,
}

/// One observation at the estimate.
struct Weighed {
    /// −∂e of all unknowns.
    jacobian: SMatrix<f64, 3, ALL>,
    inverse_cov: Matrix3<f64>,
    misclosure: Vector3<f64>,
    /// By how much its weight changes with its misclosure, relative to the weight.
    reweighting: f64,
}

/// Sums over the observations of a block, by φ's small motion and by the errors in their own units.
#[derive(Debug, Clone, Copy)]
struct AugmentedSums {
    information: SMatrix<f64, ALL, ALL>,
    /// By how much the score's derivative is less than the information, because weights change as well.
    reweighting: SMatrix<f64, ALL, ALL>,
    score: SVector<f64, ALL>,
}

impl Default for AugmentedSums {
    fn default() -> Self {
        Self { information: SMatrix::zeros(), reweighting: SMatrix::zeros(), score: SVector::zeros() }
    }
}

impl AugmentedSums {
    fn by_block(
        observations: &[SensedTrack],
        at: &At<'_>,
        blocks: &Blocks,
        residuals: &ResidualModel,
    ) -> Vec<Self> {
        let strips: Vec<Vec<(usize, Self)>> =
            observations.par_chunks(STRIP).map(|strip| Self::runs(strip, at, blocks, residuals)).collect();
        let mut by_block = vec![Self::default(); blocks.count()];
        for (block, sums) in strips.iter().flatten() {
            by_block[*block].merge(sums);
        }
        by_block
    }

    /// One for each run of observations that lie in one block.
    fn runs(
        strip: &[SensedTrack],
        at: &At<'_>,
        blocks: &Blocks,
        residuals: &ResidualModel,
    ) -> Vec<(usize, Self)> {
        let mut runs: Vec<(usize, Self)> = Vec::new();
        for sensed in strip {
            let (x, y) = sensed.track.position();
            let block = blocks.index(x, y);
            if runs.last().is_none_or(|(last, _)| *last != block) {
                runs.push((block, Self::default()));
            }
            if let Some((_, sums)) = runs.last_mut() {
                sums.add(sensed, at, residuals);
            }
        }
        runs
    }

    fn add(&mut self, sensed: &SensedTrack, at: &At<'_>, residuals: &ResidualModel) {
        // Once to move the structure to where it settles.
        let mut structure: Vector3<f64> = sensed.track.structure();
        let _measured = sensed.track.linearise(&mut structure, &at.motion);
        let settled = structure;
        let Some(l) = sensed.track.linearise(&mut structure, &at.motion) else { return };
        let error_jacobian = sensed.error_jacobian(at.errors, &settled, &l.motion_jacobian, &at.motion);
        let Some(error_jacobian) = error_jacobian else { return };
        let mut jacobian = SMatrix::<f64, 3, ALL>::zeros();
        jacobian.fixed_columns_mut::<6>(0).copy_from(&l.motion_jacobian);
        jacobian.fixed_columns_mut::<ERRORS>(6).copy_from(&error_jacobian);
        let inverse_cov = l.inverse_cov / residuals.scale2;
        let q = l.e.dot(&product(&inverse_cov, &l.e));
        let (weight, slope) = residuals.mixture.weight(q);
        let reweighting = slope / weight.max(f64::MIN_POSITIVE);
        let one = Weighed { jacobian, inverse_cov: inverse_cov * weight, misclosure: l.e, reweighting };
        // Of the errors of other parts of the sensor the derivatives are zero.
        match sensed.source {
            TrackSource::Stereo => self.add_columns::<{ 6 + RIG_ERRORS }>(&one, |i| i),
            TrackSource::Image => {
                self.add_columns::<{ ALL - RIGHT_CAMERA }>(&one, |i| if i < 6 { i } else { i + RIGHT_CAMERA })
            }
            TrackSource::Depth => self.add_columns::<{ ALL - RIGHT_CAMERA - SHUTTER }>(&one, |i| match i {
                0..6 => i,
                _ if i + RIGHT_CAMERA < 6 + RIG_ERRORS => i + RIGHT_CAMERA,
                _ => i + RIGHT_CAMERA + SHUTTER,
            }),
        }
    }

    /// Add what an observation says of K of the unknowns, of which the i-th is `place(i)`.
    #[inline(always)]
    fn add_columns<const K: usize>(&mut self, one: &Weighed, place: impl Fn(usize) -> usize) {
        let by = SMatrix::<f64, 3, K>::from_fn(|r, i| one.jacobian[(r, place(i))]);
        let weighted = product(&by.transpose(), &one.inverse_cov);
        let (information, score) = (product(&weighted, &by), product(&weighted, &one.misclosure));
        for j in 0..K {
            let (column, reweighted) = (place(j), score[j] * one.reweighting);
            self.score[column] += score[j];
            for i in 0..K {
                self.information[(place(i), column)] += information[(i, j)];
                self.reweighting[(place(i), column)] += score[i] * reweighted;
            }
        }
    }

    fn merge(&mut self, other: &Self) {
        self.information += other.information;
        self.reweighting += other.reweighting;
        self.score += other.score;
    }

    /// The sums by φ and by the errors in units of their prior standard deviations.
    fn score(&self, at: &LinearisationPoint<'_>, prior: &SensorPrior) -> AugmentedScore {
        let mut units = SMatrix::<f64, ALL, ALL>::identity();
        units.fixed_view_mut::<6, 6>(0, 0).copy_from(&StereoTrack::small_motion_jacobian(at));
        for (k, sigma) in prior.sigma.iter().enumerate() {
            units[(6 + k, 6 + k)] = *sigma;
        }
        let across = units.transpose();
        AugmentedScore {
            score: BlockScore { information: across * self.information * units, score: across * self.score },
            reweighting: across * self.reweighting * units,
        }
    }
}

/// Sums over the observations of a block, by all unknowns.
#[derive(Debug, Clone, Copy)]
struct AugmentedScore {
    score: BlockScore<ALL>,
    reweighting: SMatrix<f64, ALL, ALL>,
}

/// The system of all unknowns, solved.
struct AugmentedSolution {
    step: SVector<f64, ALL>,
    /// Inverse derivative of the total score, with the prior.
    inverse: SMatrix<f64, ALL, ALL>,
    /// By how much blocks scatter more than independent rows would.
    design_effect: f64,
}

impl AugmentedSolution {
    fn of(by_block: &[AugmentedScore], errors: &SVector<f64, ERRORS>) -> Option<Self> {
        let information: SMatrix<f64, ALL, ALL> = by_block.iter().map(|b| b.score.information).sum();
        let score: SVector<f64, ALL> = by_block.iter().map(|b| b.score.score).sum();
        let reweighting: SMatrix<f64, ALL, ALL> = by_block.iter().map(|b| b.reweighting).sum();
        let design_effect = design_effect(by_block, &information)?;
        let mut prior = SMatrix::<f64, ALL, ALL>::zeros();
        let mut score = score;
        for k in 0..ERRORS {
            prior[(6 + k, 6 + k)] = design_effect;
            score[6 + k] -= design_effect * errors[k];
        }
        let plain = (information + prior).cholesky()?;
        let bread = (information + prior - reweighting).cholesky();
        let inverse = bread.map_or_else(|| plain.inverse(), |bread| bread.inverse());
        Some(Self { step: plain.solve(&score), inverse, design_effect })
    }

    /// Of φ: what the blocks' scatter makes of it, and what the prior leaves open.
    fn covariance(&self, by_block: &[AugmentedScore]) -> Option<Matrix6<f64>> {
        let of_phi: Matrix6<f64> = self.inverse.fixed_view::<6, 6>(0, 0).into();
        let across: SMatrix<f64, 6, ERRORS> = self.inverse.fixed_view::<6, ERRORS>(0, 6).into();
        // Eliminates the errors from a score.
        let mut eliminate = SMatrix::<f64, 6, ALL>::zeros();
        eliminate.fixed_view_mut::<6, 6>(0, 0).fill_with_identity();
        eliminate.fixed_view_mut::<6, ERRORS>(0, 6).copy_from(&(of_phi.try_inverse()? * across));
        let scores: Vec<BlockScore<6>> = by_block
            .iter()
            .map(|sums| BlockScore {
                information: eliminate * sums.score.information * eliminate.transpose(),
                score: eliminate * sums.score.score,
            })
            .collect();
        let total: Matrix6<f64> = scores.iter().map(|block| block.information).sum();
        let observability = Observability::of(&total).ok()?;
        let cov = covariance(&scores, Some(&of_phi), &observability);
        // The calibration is the same in all pairs: what it leaves open is no part of this one's own.
        let apart = across.fixed_columns::<{ ERRORS - RIG_ERRORS }>(RIG_ERRORS);
        let cov = cov + apart * apart.transpose() * self.design_effect.powi(2);
        cov.iter().all(|v| v.is_finite()).then_some(cov)
    }
}

impl AugmentedSolution {
    /// How φ̂ answers to errors of the calibration, of which `unit` is the inverse of their prior standard deviations.
    ///
    /// Without noise H (δφ, û − u) = −D (0, u), so that φ̂ moves by −D H⁻¹ u.
    fn phi_per_rig_error(&self, unit: &SVector<f64, ERRORS>) -> SMatrix<f64, 6, RIG_ERRORS> {
        let across: SMatrix<f64, 6, RIG_ERRORS> = self.inverse.fixed_view::<6, RIG_ERRORS>(0, 6).into();
        let unit: SVector<f64, RIG_ERRORS> = unit.fixed_rows::<RIG_ERRORS>(0).into();
        across * SMatrix::from_diagonal(&unit) * -self.design_effect
    }
}

/// tr(A⁻¹ M)/6 of φ, where A is the information and M the sum of the blocks' squared scores; at least 1.
fn design_effect(by_block: &[AugmentedScore], information: &SMatrix<f64, ALL, ALL>) -> Option<f64> {
    let of_phi: Matrix6<f64> = information.fixed_view::<6, 6>(0, 0).into();
    let observability = Observability::of(&of_phi).ok()?;
    if observability.rank() < 6 {
        return None;
    }
    let of_phi = of_phi.cholesky()?;
    let square = |sums: &AugmentedScore| {
        let score: Vector6<f64> = sums.score.score.fixed_rows::<6>(0).into();
        score.dot(&of_phi.solve(&score))
    };
    let scatter: f64 = by_block.iter().map(square).sum();
    Some((scatter / 6.0).max(1.0))
}
