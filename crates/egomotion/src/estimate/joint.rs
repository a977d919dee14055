//! φ and the sensor's errors at once: one Gauss–Newton step, and the covariance of φ that includes them.
//!
//! The errors u, in units of their prior standard deviations, join φ as unknowns: with Y = (G, X) and the prior
//! u ~ N(0, 1), (Σ w Yᵀ S⁻¹ Y + D diag(0, 1)) δ = Σ w Yᵀ S⁻¹ e − D (0, u). Observations near each other share their noise
//! and say less than their number; D, by how much the scatter of the blocks' scores exceeds what independent rows
//! would have, keeps them from overruling the prior (the adjustment of composite likelihoods). The covariance is the
//! sandwich of [`super::blocks`] with the errors eliminated from each block's score, and the prior's own part.

use nalgebra::{Matrix6, SMatrix, SVector, Vector3, Vector6};
use rayon::prelude::*;

use super::Observability;
use super::blocks::{self, BlockScore, Blocks};
use super::m_estimator::StudentT;
use super::measurement::{At, Measurement, squares};
use super::mixture::Mixture;
use super::tolerance::{ERRORS, Sensed, SensorErrors, SensorPrior};
use crate::geometry::{StereoRig, Twist};
use crate::observe::StereoTrack;

/// φ and errors.
const ALL: usize = 6 + ERRORS;
/// Observations handled by one task; fixed, so that sums do not depend on the number of threads.
const STRIP: usize = 512;
/// Passes that move structures to where they settle at a motion.
const PASSES: usize = 2;

/// What one step towards the most likely motion and errors says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// By how much φ moves.
    pub step: Vector6<f64>,
    /// The errors after the step.
    pub errors: SensorErrors,
    /// Covariance of φ with what the errors add.
    pub cov: Matrix6<f64>,
}

/// Step from φ and `errors`, for which `observations` are corrected already; `None` where some direction of motion is
/// not determined.
pub fn joint_step(
    observations: &[Sensed],
    rig: &StereoRig,
    phi: &Twist,
    errors: &SensorErrors,
    prior: &SensorPrior,
    blocks: &Blocks,
    kernel: &StudentT,
) -> Option<Joint> {
    let at = At::new(*phi, rig);
    let tracks: Vec<StereoTrack> = observations.iter().map(|sensed| sensed.track).collect();
    let (mixture, scale2) = Mixture::of(kernel, &mut squares(&tracks, &at))?;
    let weighing = Weighing { mixture, scale2, prior, blocks };
    let by_block = Sums::by_block(observations, &at, &weighing);
    let unit = prior.sigma.map(|sigma| if sigma > 0.0 { sigma.recip() } else { 0.0 });
    let solved = Solved::of(&by_block, &errors.vector().component_mul(&unit))?;
    let moved = errors.vector() + solved.step.fixed_rows::<ERRORS>(6).component_mul(&prior.sigma);
    Some(Joint {
        step: solved.step.fixed_rows::<6>(0).into(),
        errors: SensorErrors::from_vector(&moved),
        cov: solved.covariance(&by_block)?,
    })
}

struct Weighing<'a> {
    mixture: Mixture,
    scale2: f64,
    prior: &'a SensorPrior,
    blocks: &'a Blocks,
}

/// Sums over the observations of a block.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    score: BlockScore<ALL>,
    /// By how much the score's derivative is less than the information, because weights change as well.
    reweighting: BlockScore<ALL>,
}

impl Sums {
    fn by_block(observations: &[Sensed], at: &At<'_>, weighing: &Weighing<'_>) -> Vec<Self> {
        let strips: Vec<Vec<(usize, Self)>> =
            observations.par_chunks(STRIP).map(|strip| Self::runs(strip, at, weighing)).collect();
        let mut by_block = vec![Self::default(); weighing.blocks.count()];
        for (block, sums) in strips.iter().flatten() {
            by_block[*block].merge(sums);
        }
        let jacobian = StereoTrack::by_phi(at);
        by_block.iter_mut().for_each(|sums| sums.by_phi(&jacobian));
        by_block
    }

    /// One for each run of observations that lie in one block.
    fn runs(strip: &[Sensed], at: &At<'_>, weighing: &Weighing<'_>) -> Vec<(usize, Self)> {
        let mut runs: Vec<(usize, Self)> = Vec::new();
        for sensed in strip {
            let (x, y) = sensed.track.position();
            let block = weighing.blocks.index(x, y);
            match runs.last_mut() {
                Some((last, sums)) if *last == block => sums.add(sensed, at, weighing),
                _ => {
                    let mut sums = Self::default();
                    sums.add(sensed, at, weighing);
                    runs.push((block, sums));
                }
            }
        }
        runs
    }

    fn add(&mut self, sensed: &Sensed, at: &At<'_>, weighing: &Weighing<'_>) {
        let mut structure: Vector3<f64> = sensed.track.structure();
        for _ in 0..PASSES {
            let _settling = sensed.track.linearise(&mut structure, at);
        }
        let settled = structure;
        let Some(l) = sensed.track.linearise(&mut structure, at) else { return };
        let Some(by_errors) = sensed.by_errors(&settled, &l.by_motion, at) else { return };
        let mut by_all = SMatrix::<f64, 3, ALL>::zeros();
        by_all.fixed_columns_mut::<6>(0).copy_from(&l.by_motion);
        for k in 0..ERRORS {
            by_all.set_column(6 + k, &(by_errors.column(k) * weighing.prior.sigma[k]));
        }
        let inverse_cov = l.inverse_cov / weighing.scale2;
        let q = l.misclosure.dot(&(inverse_cov * l.misclosure));
        let (weight, slope) = weighing.mixture.weight(q);
        let weighted = by_all.transpose() * (inverse_cov * weight);
        self.score.information += weighted * by_all;
        self.score.score += weighted * l.misclosure;
        let pull = by_all.transpose() * (inverse_cov * l.misclosure);
        self.reweighting.information += pull * pull.transpose() * (weight * slope);
    }

    fn merge(&mut self, other: &Self) {
        self.score.information += other.score.information;
        self.score.score += other.score.score;
        self.reweighting.information += other.reweighting.information;
    }

    /// Sums by the small motion of a measurement as sums by φ.
    fn by_phi(&mut self, jacobian: &Matrix6<f64>) {
        let mut all = SMatrix::<f64, ALL, ALL>::identity();
        all.fixed_view_mut::<6, 6>(0, 0).copy_from(jacobian);
        let across = all.transpose();
        self.score.information = across * self.score.information * all;
        self.score.score = across * self.score.score;
        self.reweighting.information = across * self.reweighting.information * all;
    }
}

/// The system of all unknowns, solved.
struct Solved {
    step: SVector<f64, ALL>,
    /// Inverse derivative of the total score, with the prior.
    inverse: SMatrix<f64, ALL, ALL>,
    /// By how much blocks scatter more than independent rows would.
    design_effect: f64,
}

impl Solved {
    fn of(by_block: &[Sums], errors: &SVector<f64, ERRORS>) -> Option<Self> {
        let information: SMatrix<f64, ALL, ALL> = by_block.iter().map(|b| b.score.information).sum();
        let score: SVector<f64, ALL> = by_block.iter().map(|b| b.score.score).sum();
        let reweighting: SMatrix<f64, ALL, ALL> = by_block.iter().map(|b| b.reweighting.information).sum();
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
    fn covariance(&self, by_block: &[Sums]) -> Option<Matrix6<f64>> {
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
        let cov = blocks::covariance(&scores, Some(&of_phi), &observability);
        let cov = cov + self.design_effect.powi(2) * across * across.transpose();
        cov.iter().all(|v| v.is_finite()).then_some(cov)
    }
}

/// tr(A⁻¹ M)/6 of φ, where A is the information and M the sum of the blocks' squared scores; at least 1.
fn design_effect(by_block: &[Sums], information: &SMatrix<f64, ALL, ALL>) -> Option<f64> {
    let of_phi: Matrix6<f64> = information.fixed_view::<6, 6>(0, 0).into();
    let observability = Observability::of(&of_phi).ok()?;
    if observability.rank() < 6 {
        return None;
    }
    let of_phi = of_phi.cholesky()?;
    let square = |sums: &Sums| {
        let score: Vector6<f64> = sums.score.score.fixed_rows::<6>(0).into();
        score.dot(&of_phi.solve(&score))
    };
    let scatter: f64 = by_block.iter().map(square).sum();
    Some((scatter / 6.0).max(1.0))
}
