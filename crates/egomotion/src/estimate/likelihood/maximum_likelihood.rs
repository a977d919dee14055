//! Maximum likelihood in the measured quantities, over φ and every point's true position at once.
//!
//! Each observation has three equations f(measured, φ) = 0 after its own structure is eliminated.
//! With e their misclosure linearised at the current structure, S its covariance and G its
//! derivative by φ, Gauss–Newton solves Σ Gᵀ S⁻¹ G δ = Σ Gᵀ S⁻¹ e; a zero variance before the
//! motion is legal because S, never the measurement's covariance alone, is inverted. Robust
//! weights are functions of q = eᵀ S⁻¹ e: those of Student's t beside a share of outliers, both as the
//! residuals have them (the mixture of a t and outliers).

use documented::DocumentedFields;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::mixture::ResidualModel;
use super::score_sums::{FrameSums, LikelihoodTerm, Weighing, median_square, squares};
use super::step::{self, Accepted};
use super::systematic::SystematicResponse;
use crate::constrain::{LinearisationPoint, Measurement};
use crate::estimate::certainty::blocks::{BlockScore, Blocks};
use crate::estimate::certainty::covariance::{covariance, model_covariance};
use crate::estimate::certainty::neighbours::BlockInfluences;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::motion_estimate::{Estimate, MotionEstimate};
use crate::estimate::student_t::{LEAST_SCALE2, StudentT};
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::{Gaussian, StereoRig, Twist};

/// An answer is not believed whose median of q is this many times that of the robust start: a mixture fitted to few
/// observations may see some that happen to agree, and call the others outliers.
const ASTRAY_MEDIAN_RATIO: f64 = 1.5;
/// About this many observations bring the iteration near its end before all of them are used: fewer are cheaper, and
/// leave more to the steps over all.
const COARSE_OBSERVATIONS: usize = 4096;
/// The iteration over few observations ends when φ moves by less than this share of its standard deviation; then the
/// residuals are looked at again.
const COARSE_TOLERANCE: f64 = 0.3;
/// The residuals are looked at again this often on the way, since far from the end they do not look as they do there.
const RESIDUAL_FITS: usize = 2;
/// Newton's steps are taken at most this often. Where they do not settle, Gauss–Newton's follow: each of them is one of
/// expectation and maximisation, by which the likelihood does not fall.
const NEWTON_STEPS: usize = 12;
/// The ratio of a step to the last is taken as at most this when the sum of those to come is foretold: a ratio near 1
/// would foretell an endless way.
const LARGEST_STEP_RATIO: f64 = 0.5;

/// After the last iteration φ is good if it moved by no more than this share of its standard deviation: the gradient is
/// then zero within its noise.
const LAST_STEP_SIGMAS: f64 = 0.1;

/// How maximum likelihood iterates and weighs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct MaximumLikelihoodOptions {
    /// Distribution of the residuals: found from them, or Student's t; `nu` infinite is the Gaussian.
    pub kernel: StudentT,
    /// Largest share of outliers that the robust start provides for.
    pub outliers: f64,
    /// Probability that the robust start sees a clean subset.
    pub confidence: f64,
    /// The robust start judges candidates on at most this many observations.
    pub start_observations: usize,
    /// Seed of the robust start.
    pub seed: u64,
    /// Standard deviation of the phase error's amplitude, in pixels.
    pub phase_error_px: f64,
    /// Standard deviation of the field error, in pixels: matches in a block of the image are off by it together, in all
    /// frames.
    pub field_error_px: f64,
}

impl Default for MaximumLikelihoodOptions {
    fn default() -> Self {
        Self {
            kernel: StudentT::default(),
            outliers: 0.6,
            confidence: 0.999,
            start_observations: 600,
            seed: 1,
            phase_error_px: 0.003,
            field_error_px: 0.003,
        }
    }
}

/// A maximum-likelihood estimate with what tests and studies ask of it.
#[derive(Debug, Clone, PartialEq)]
pub struct MaximumLikelihood {
    /// φ̂ with its covariance.
    pub motion: MotionEstimate,
    /// Σ eᵀ S⁻¹ e at the estimate, without robust weights.
    pub cost: f64,
    /// How φ̂ answers to systematic errors; `None` without blocks, and where some direction is not determined.
    pub systematic: Option<SystematicResponse>,
    /// The influences of the blocks of the earlier frame and of the later one; `None` where the former is.
    pub(crate) influences: Option<[BlockInfluences; 2]>,
    /// How residuals were weighed.
    pub(crate) residuals: ResidualModel,
}

/// Maximise the likelihood from a start.
///
/// Sixty points that move towards the rig by 0.1 m and turn about Y by 0.01 rad, each measured to 0.1 px:
///
/// ```
/// use egomotion::estimate::{StudentT, maximum_likelihood};
/// use egomotion::geometry::{Gaussian, StereoRig, Twist};
/// use egomotion::observe::StereoTrack;
/// use nalgebra::{Matrix3, Vector3};
///
/// let rig = StereoRig::new(400.0, (319.5, 239.5), 0.2, (640, 480))?;
/// let truth = Twist { t: Vector3::new(0.0, 0.0, -0.1), omega: Vector3::new(0.0, 0.01, 0.0) };
/// let seen = |point: &Vector3<f64>| -> Option<Gaussian<3>> {
///     Some(Gaussian { mean: rig.project(point)?, cov: Matrix3::identity() * 0.1 * 0.1 })
/// };
/// let tracks: Vec<StereoTrack> = (0..60)
///     .map(|i| Vector3::new((i % 8) as f64 - 3.5, (i % 5) as f64 - 2.0, 4.0 + 0.1 * i as f64))
///     .filter_map(|p| Some(StereoTrack { before: seen(&p)?, after: seen(&truth.exp().apply(&p))? }))
///     .collect();
/// let gaussian = StudentT { nu: f64::INFINITY, ..StudentT::default() };
/// let found = maximum_likelihood(&tracks, &rig, &Twist::zero(), None, &gaussian)?;
/// assert!((found.motion.phi().vector() - truth.vector()).amax() < 1e-6);
/// assert!(found.motion.theta.sigma(2) < 0.01, "tZ is known to millimetres");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// With `blocks` the covariance is block-wise, without them it is the model's: the inverse
/// Gauss–Newton information with the structure eliminated, at the estimated structure, with a robust kernel
/// times what its scale and weights make of independent residuals.
///
/// # Errors
/// [`Unsolvable`] with fewer than three usable observations, without any determined direction, or
/// when it does not settle.
pub fn maximum_likelihood<M: LikelihoodTerm>(
    observations: &[M],
    rig: &StereoRig,
    start: &Twist,
    blocks: Option<&Blocks>,
    kernel: &StudentT,
) -> Result<MaximumLikelihood, Unsolvable> {
    let stride = (observations.len() / COARSE_OBSERVATIONS).max(1);
    let few: Vec<M> = observations.iter().step_by(stride).copied().collect();
    let found = maximise(observations, &few, rig, start, blocks, kernel);
    if !(kernel.nu.is_finite() && kernel.fitted) {
        return found;
    }
    let is_astray = |found: &MaximumLikelihood| {
        median_square(&found.motion.phi_or_zero(), &few, rig)
            > ASTRAY_MEDIAN_RATIO * median_square(start, &few, rig)
    };
    let again = match &found {
        Ok(found) => is_astray(found),
        Err(why) => matches!(why, Unsolvable::NotConverged | Unsolvable::FewRows { .. }),
    };
    if !again {
        return found;
    }
    let student = maximise(observations, &few, rig, start, blocks, &StudentT { fitted: false, ..*kernel })?;
    // Between the scene and a large body there is a motion that neither has.
    if found.is_err() && is_astray(&student) { Err(Unsolvable::NotConverged) } else { Ok(student) }
}

/// The maximum near a start; `few` of the observations bring the iteration near its end.
fn maximise<M: LikelihoodTerm>(
    observations: &[M],
    few: &[M],
    rig: &StereoRig,
    start: &Twist,
    blocks: Option<&Blocks>,
    kernel: &StudentT,
) -> Result<MaximumLikelihood, Unsolvable> {
    let near = Iterate::begin(observations, rig, start, kernel)?.approach(few, rig, kernel)?;
    let settled = near.settle(observations, rig, blocks, kernel)?;
    finish(settled, observations, rig, blocks, kernel)
}

/// Where the iteration ends: the sums of its last step, and the structures.
struct Settled {
    iterate: Iterate,
    sums: FrameSums,
    structures: Vec<Vector3<f64>>,
}

/// Where the iteration is.
#[derive(Debug, Clone, Copy)]
struct Iterate {
    phi: Twist,
    residuals: ResidualModel,
}

impl Iterate {
    /// Residuals as they are at a motion.
    fn begin<M: LikelihoodTerm>(
        observations: &[M],
        rig: &StereoRig,
        phi: &Twist,
        kernel: &StudentT,
    ) -> Result<Self, Unsolvable> {
        let stride = observations.len().div_ceil(COARSE_OBSERVATIONS).max(1);
        let few: Vec<M> = observations.iter().step_by(stride).copied().collect();
        let residuals = ResidualModel::of(kernel, &mut squares(&few, &LinearisationPoint::new(*phi, rig)))
            .ok_or(Unsolvable::FewRows { rows: 0, needed: 3 })?;
        Ok(Self { phi: *phi, residuals })
    }

    /// Near the end: what residuals look like far from it is not what they look like there.
    fn approach<M: LikelihoodTerm>(
        mut self,
        observations: &[M],
        rig: &StereoRig,
        kernel: &StudentT,
    ) -> Result<Self, Unsolvable> {
        let rough = StudentT { tolerance: COARSE_TOLERANCE, ..*kernel };
        for _ in 0..if kernel.nu.is_finite() && kernel.fitted { RESIDUAL_FITS } else { 1 } {
            // Few observations may leave open what all determine.
            let Ok(found) = self.settle(observations, rig, None, &rough) else { return Ok(self) };
            self = Self::begin(observations, rig, &found.iterate.phi, kernel)?;
        }
        Ok(self)
    }

    /// Iterate until φ moves by less than the tolerance; with the sums of the last step.
    ///
    /// A step is taken back and damped (Levenberg and Marquardt) where the likelihood falls and the score does not.
    fn settle<M: LikelihoodTerm>(
        mut self,
        observations: &[M],
        rig: &StereoRig,
        blocks: Option<&Blocks>,
        kernel: &StudentT,
    ) -> Result<Settled, Unsolvable> {
        let mut structures: Vec<Vector3<f64>> = observations.iter().map(Measurement::structure).collect();
        let (mut damping, mut last_moved) = (0.0, 0.0);
        let mut accepted: Option<Accepted> = None;
        for iteration in 0..kernel.iterations {
            let at = LinearisationPoint::new(self.phi, rig);
            let weighing = Weighing { blocks, in_later: false, residuals: self.residuals };
            let sums = FrameSums::linearised(observations, &mut structures, &at, &weighing);
            let cost = sums.whole.cost(self.residuals.scale2);
            if let Some(best) = accepted.as_ref().filter(|best| best.is_better_than(cost, &sums.whole)) {
                damping = step::more(damping);
                self.phi = best.stepped(&step::direction(&best.sums.whole, false, damping)?);
                structures.clone_from(&best.structures);
                last_moved = 0.0;
                continue;
            }
            damping = step::less(damping);
            let whole = &sums.whole;
            if whole.used < 3 {
                return Err(Unsolvable::FewRows { rows: whole.used, needed: 3 });
            }
            let delta = step::direction(whole, iteration < NEWTON_STEPS, damping)?;
            let from = self.phi;
            self.phi = Twist::from_vector(&(from.vector() + delta));
            // Beside outliers a scale that follows the weights, which follow the scale, may shrink to nothing: it stays
            // as it was found (the MM-estimator of Yohai 1987).
            if kernel.nu.is_finite() && !self.residuals.mixture.has_outliers() {
                self.residuals.scale2 = whole.scale2().max(LEAST_SCALE2);
            }
            let moved = delta.dot(&(whole.score.information * delta)).max(0.0).sqrt();
            // Steps that shrink by a factor are followed by ones that sum up to this.
            let factor = (moved / last_moved).min(LARGEST_STEP_RATIO);
            let rest = moved * factor / (1.0 - factor);
            last_moved = moved;
            // The first step was one with structures as measured: where it ends depends on their noise.
            if iteration > 0 && damping == 0.0 && rest <= kernel.tolerance * self.residuals.scale2.sqrt() {
                return Ok(Settled { iterate: self, sums, structures });
            }
            accepted = Some(Accepted { phi: from, structures: structures.clone(), cost, sums });
        }
        // Expectation and maximisation come near the end slowly: what is left of the way is small beside φ's own error.
        let near = damping == 0.0 && last_moved <= LAST_STEP_SIGMAS * self.residuals.scale2.sqrt();
        let end = |last: Accepted| Settled { iterate: self, sums: last.sums, structures };
        accepted.filter(|_| near).map(end).ok_or(Unsolvable::NotConverged)
    }
}

/// The answer from the sums of the last step, which was less than the tolerance.
fn finish<M: LikelihoodTerm>(
    settled: Settled,
    observations: &[M],
    rig: &StereoRig,
    blocks: Option<&Blocks>,
    kernel: &StudentT,
) -> Result<MaximumLikelihood, Unsolvable> {
    let Settled { iterate: found, sums, structures } = settled;
    let whole = &sums.whole;
    let observability = Observability::of(&whole.score.information)?;
    let cov = match blocks {
        Some(_) => {
            let scores: Vec<BlockScore<6>> = sums.by_block.iter().map(|step| step.score).collect();
            covariance(&scores, whole.bread().try_inverse().as_ref(), &observability)
        }
        None if kernel.nu.is_infinite() => model_covariance(1.0, &observability),
        None => model_covariance(whole.spread(), &observability),
    };
    let freedom = (3 * whole.used).saturating_sub(6).max(1) as f64;
    let at = LinearisationPoint::new(found.phi, rig);
    let systematic = blocks.and_then(|_| SystematicResponse::of(observations, &at, &found.residuals, blocks));
    let influences = systematic.zip(blocks).and_then(|(_, blocks)| {
        let weighing = Weighing { blocks: Some(blocks), in_later: true, residuals: found.residuals };
        influences(&sums, observations, structures, &at, &weighing)
    });
    Ok(MaximumLikelihood {
        motion: Estimate {
            theta: Gaussian { mean: observability.with_unobserved_nan(&found.phi.vector()), cov },
            observed: observability.observed(),
            undetermined: observability.undetermined(),
            rows: observations.len(),
            inliers: whole.inliers,
            residual_scale: (whole.weighted_square / freedom).sqrt(),
        },
        cost: whole.square,
        systematic,
        influences,
        residuals: found.residuals,
    })
}

/// The influence of each block of the earlier frame, of the last step's sums, and of each of the later one.
fn influences<M: LikelihoodTerm>(
    sums: &FrameSums,
    observations: &[M],
    mut structures: Vec<Vector3<f64>>,
    at: &LinearisationPoint<'_>,
    in_later: &Weighing<'_>,
) -> Option<[BlockInfluences; 2]> {
    let inverse = sums.whole.bread().try_inverse()?;
    let later = FrameSums::linearised(observations, &mut structures, at, in_later);
    let of =
        |sums: &FrameSums| BlockInfluences(sums.by_block.iter().map(|b| inverse * b.score.score).collect());
    Some([of(sums), of(&later)])
}
