//! Maximum likelihood in the measured quantities, over φ and every point's true position at once.
//!
//! Each observation has three equations f(measured, φ) = 0 after its own structure is eliminated.
//! With e their misclosure linearised at the current structure, S its covariance and G its
//! derivative by φ, Gauss–Newton solves Σ Gᵀ S⁻¹ G δ = Σ Gᵀ S⁻¹ e; a zero variance before the
//! motion is legal because S, never the measurement's covariance alone, is inverted. Robust
//! weights are functions of q = eᵀ S⁻¹ e: those of Student's t beside a share of outliers, both as the
//! residuals have them ([`crate::estimate::likelihood::mixture`]).

use documented::DocumentedFields;
use nalgebra::{Matrix6, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::estimate::certainty::blocks::{self, BlockScore, Blocks};
use crate::estimate::likelihood::mixture::Mixture;
use crate::estimate::likelihood::step::{Step, Sums, Weighing};
use crate::estimate::linear::m_estimator::{LEAST_SCALE2, StudentT};
use crate::estimate::measurement::{At, Measurement, median_square, squares};
use crate::estimate::sensor::systematic::CommonErrors;
use crate::estimate::{Estimate, MotionEstimate, Observability, Unsolvable};
use crate::geometry::{Gaussian, StereoRig, Twist};

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
    /// Standard deviation of the phase error's amplitude, in pixels; see [`crate::estimate::sensor::systematic`].
    pub phase_error_px: f64,
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
        }
    }
}

/// A maximum-likelihood estimate with what tests and studies ask of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaximumLikelihood {
    /// φ̂ with its covariance.
    pub motion: MotionEstimate,
    /// Σ eᵀ S⁻¹ e at the estimate, without robust weights.
    pub cost: f64,
    /// How φ̂ answers to errors that all observations share; `None` where some direction is not determined.
    pub common: Option<CommonErrors>,
    /// How residuals were weighed, in units of the squared scale.
    pub(crate) mixture: Mixture,
    pub(crate) scale2: f64,
}

/// Maximise the likelihood from a start.
///
/// With `blocks` the covariance is block-wise, without them it is the model's: the inverse
/// Gauss–Newton information with the structure eliminated, at the estimated structure, with a robust kernel
/// times what its scale and weights make of independent residuals.
///
/// # Errors
/// [`Unsolvable`] with fewer than three usable observations, without any determined direction, or
/// when it does not settle.
pub fn maximum_likelihood<M: Measurement>(
    observations: &[M],
    rig: &StereoRig,
    start: &Twist,
    blocks: Option<&Blocks>,
    kernel: &StudentT,
) -> Result<MaximumLikelihood, Unsolvable> {
    let stride = (observations.len() / COARSE).max(1);
    let few: Vec<M> = observations.iter().step_by(stride).copied().collect();
    let found = maximise(observations, &few, rig, start, blocks, kernel);
    if !(kernel.nu.is_finite() && kernel.fitted) {
        return found;
    }
    // Of few observations a mixture may see but some that happen to agree, and call the others outliers.
    let astray = match &found {
        Ok(found) => median_square(&found.motion.phi(), &few, rig) > ASTRAY * median_square(start, &few, rig),
        Err(why) => *why == Unsolvable::NotConverged,
    };
    if astray {
        return maximise(observations, &few, rig, start, blocks, &StudentT { fitted: false, ..*kernel });
    }
    found
}

/// An answer is not believed whose median of q is so many times that of the robust start.
const ASTRAY: f64 = 1.5;

/// The maximum near a start; `few` of the observations bring the iteration near its end.
fn maximise<M: Measurement>(
    observations: &[M],
    few: &[M],
    rig: &StereoRig,
    start: &Twist,
    blocks: Option<&Blocks>,
    kernel: &StudentT,
) -> Result<MaximumLikelihood, Unsolvable> {
    let search = Search::begin(observations, rig, start, kernel)?.approach(few, rig, kernel)?;
    let (found, sums) = search.settle(observations, rig, blocks, kernel)?;
    finish(&found, &sums, observations.len(), blocks, kernel)
}

/// About so many observations bring the iteration near its end before all of them are used.
const COARSE: usize = 4096;
/// How near, as a share of the standard deviation, is near enough to look at the residuals again,
const ROUGH: f64 = 0.3;
/// which is done so often.
const LOOKS: usize = 2;

/// Where the iteration is.
#[derive(Debug, Clone, Copy)]
struct Search {
    phi: Twist,
    /// What the misclosures look like in units of their stated covariance, times the squared scale.
    mixture: Mixture,
    scale2: f64,
}

impl Search {
    /// Residuals as they are at a motion.
    fn begin<M: Measurement>(
        observations: &[M],
        rig: &StereoRig,
        phi: &Twist,
        kernel: &StudentT,
    ) -> Result<Self, Unsolvable> {
        let stride = observations.len().div_ceil(COARSE).max(1);
        let few: Vec<M> = observations.iter().step_by(stride).copied().collect();
        let (mixture, scale2) = Mixture::of(kernel, &mut squares(&few, &At::new(*phi, rig)))
            .ok_or(Unsolvable::FewRows { rows: 0, needed: 3 })?;
        Ok(Self { phi: *phi, mixture, scale2 })
    }

    /// Near the end: what residuals look like far from it is not what they look like there.
    fn approach<M: Measurement>(
        mut self,
        observations: &[M],
        rig: &StereoRig,
        kernel: &StudentT,
    ) -> Result<Self, Unsolvable> {
        let rough = StudentT { tolerance: ROUGH, ..*kernel };
        for _ in 0..if kernel.nu.is_finite() && kernel.fitted { LOOKS } else { 1 } {
            // Few observations may leave open what all determine.
            let Ok((found, _)) = self.settle(observations, rig, None, &rough) else { return Ok(self) };
            self = Self::begin(observations, rig, &found.phi, kernel)?;
        }
        Ok(self)
    }

    /// Iterate until φ moves by less than the tolerance; with the sums of the last step.
    fn settle<M: Measurement>(
        mut self,
        observations: &[M],
        rig: &StereoRig,
        blocks: Option<&Blocks>,
        kernel: &StudentT,
    ) -> Result<(Self, Sums), Unsolvable> {
        let mut structures: Vec<Vector3<f64>> = observations.iter().map(Measurement::structure).collect();
        let mut last = 0.0;
        for iteration in 0..kernel.iterations {
            let at = At::new(self.phi, rig);
            let weighing = Weighing { blocks, mixture: self.mixture, scale2: self.scale2 };
            let sums = Sums::over(observations, &mut structures, &at, &weighing);
            let step = &sums.whole;
            if step.used < 3 {
                return Err(Unsolvable::FewRows { rows: step.used, needed: 3 });
            }
            let delta = direction(step, iteration < NEWTON)?;
            self.phi = Twist::from_vector(&(self.phi.vector() + delta));
            // Beside outliers a scale that follows the weights, which follow the scale, may shrink to nothing: it stays
            // as it was found (the MM-estimator of Yohai 1987).
            if kernel.nu.is_finite() && !self.mixture.has_outliers() {
                self.scale2 = step.scale2().max(LEAST_SCALE2);
            }
            let moved = delta.dot(&(step.score.information * delta)).max(0.0).sqrt();
            // Steps that shrink by a factor are followed by ones that sum up to this.
            let factor = (moved / last).min(0.5);
            let rest = moved * factor / (1.0 - factor);
            last = moved;
            // The first step was one with structures as measured: where it ends depends on their noise.
            if iteration > 0 && rest <= kernel.tolerance * self.scale2.sqrt() {
                return Ok((self, sums));
            }
        }
        Err(Unsolvable::NotConverged)
    }
}

/// The step of φ: Newton's, with the weights' own change, near the end; Gauss–Newton's elsewhere.
fn direction(step: &Step, newton: bool) -> Result<Vector6<f64>, Unsolvable> {
    let (information, score) = (&step.score.information, &step.score.score);
    let observability = Observability::of(information)?;
    let plain = observability.solve(information, score)?;
    if observability.rank() < 6 || !newton {
        return Ok(plain);
    }
    let newton = step.bread().cholesky().map(|bread| bread.solve(score));
    // Far from the end the likelihood may be flat in some direction, and Newton's step too long.
    let length = |v: &Vector6<f64>| v.dot(&(information * v));
    Ok(newton.filter(|newton| length(newton) <= LONGEST.powi(2) * length(&plain)).unwrap_or(plain))
}

/// Where Newton's steps do not settle, from so many on only Gauss–Newton's are taken: each of them is one of expectation
/// and maximisation, by which the likelihood does not fall.
const NEWTON: usize = 12;
/// Newton's step is taken unless so many times as long as Gauss–Newton's.
const LONGEST: f64 = 3.0;

/// The answer from the sums of the last step, which was less than the tolerance.
fn finish(
    found: &Search,
    sums: &Sums,
    rows: usize,
    blocks: Option<&Blocks>,
    kernel: &StudentT,
) -> Result<MaximumLikelihood, Unsolvable> {
    let whole = &sums.whole;
    let observability = Observability::of(&whole.score.information)?;
    let cov = match blocks {
        Some(_) => {
            let scores: Vec<BlockScore<6>> = sums.by_block.iter().map(|step| step.score).collect();
            blocks::covariance(&scores, whole.bread().try_inverse().as_ref(), &observability)
        }
        None if kernel.nu.is_infinite() => blocks::model_covariance(1.0, &observability),
        None => blocks::model_covariance(whole.spread(), &observability),
    };
    let freedom = (3 * whole.used).saturating_sub(6).max(1) as f64;
    Ok(MaximumLikelihood {
        motion: Estimate {
            theta: Gaussian { mean: observability.known(&found.phi.vector()), cov },
            observed: observability.observed(),
            undetermined: observability.undetermined(),
            rows,
            inliers: whole.inliers,
            residual_scale: (whole.weighted_square / freedom).sqrt(),
        },
        cost: whole.square,
        common: CommonErrors::of(whole),
        mixture: found.mixture,
        scale2: found.scale2,
    })
}

/// The inverse Fisher information of φ at a known motion and structure: no unbiased estimator does better.
///
/// `None` when some direction is not determined.
pub fn cramer_rao_bound<M: Measurement>(
    observations: &[M],
    rig: &StereoRig,
    phi: &Twist,
) -> Option<Matrix6<f64>> {
    let structures: Vec<Vector3<f64>> = observations.iter().map(Measurement::structure).collect();
    Some(efficient(observations, &structures, rig, phi)?.cov)
}

/// What no unbiased estimator does better than: one Gauss–Newton step from the true motion and structures.
///
/// Its covariance is the Cramér–Rao bound, and its error has exactly that covariance as long as the noise has
/// the one it states: estimators are compared with it draw by draw. `None` when some direction is not determined.
pub fn efficient<M: Measurement>(
    observations: &[M],
    structures: &[Vector3<f64>],
    rig: &StereoRig,
    phi: &Twist,
) -> Option<Gaussian<6>> {
    let gaussian = StudentT { nu: f64::INFINITY, ..StudentT::default() };
    let weighing = Weighing { blocks: None, mixture: Mixture::student(&gaussian), scale2: 1.0 };
    let sums = Sums::over(observations, &mut structures.to_vec(), &At::new(*phi, rig), &weighing);
    let BlockScore { information, score } = sums.whole.score;
    let observability = Observability::of(&information).ok()?;
    let observed: [bool; 6] = observability.observed();
    let step = observability.solve(&information, &score).ok()?;
    observed
        .iter()
        .all(|&o| o)
        .then(|| Gaussian { mean: phi.vector() + step, cov: blocks::model_covariance(1.0, &observability) })
}
