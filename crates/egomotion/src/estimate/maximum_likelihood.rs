//! Maximum likelihood in the measured quantities, over φ and every point's true position at once.
//!
//! Each observation has three equations f(measured, φ) = 0 after its own structure is eliminated.
//! With e their misclosure linearised at the current structure, S its covariance and G its
//! derivative by φ, Gauss–Newton solves Σ Gᵀ S⁻¹ G δ = Σ Gᵀ S⁻¹ e; a zero variance before the
//! motion is legal because S, never the measurement's covariance alone, is inverted. Robust
//! weights are those of Student's t on q = eᵀ S⁻¹ e.

use nalgebra::{Matrix6, Vector3, Vector6};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::alignment::{Form, Moments, PointPair};
use super::blocks::{self, BlockScore, Blocks};
use super::lmeds::{random_subsets, trials};
use super::m_estimator::{LEAST_SCALE2, StudentT};
use super::measurement::{At, Measurement};
use super::step::{Step, Sums, Weighing};
use super::systematic::CommonErrors;
use super::{Estimate, MotionEstimate, Observability, Unsolvable, median};
use crate::geometry::{Gaussian, StereoRig, Twist};
use crate::observe::StereoTrack;

/// How maximum likelihood iterates and weighs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MaximumLikelihoodOptions {
    /// Distribution of the residuals; `nu` infinite is the Gaussian.
    pub kernel: StudentT,
    /// Largest share of outliers that the robust start provides for.
    pub outliers: f64,
    /// Probability that the robust start sees a clean subset.
    pub confidence: f64,
    /// The robust start judges candidates on at most this many observations.
    pub start_observations: usize,
    /// Seed of the robust start.
    pub seed: u64,
    /// Standard deviation of the bias that all matches of a frame share, in pixels; see [`super::systematic`].
    pub localisation_bias_px: f64,
}

impl Default for MaximumLikelihoodOptions {
    fn default() -> Self {
        Self {
            kernel: StudentT::default(),
            outliers: 0.6,
            confidence: 0.999,
            start_observations: 600,
            seed: 1,
            localisation_bias_px: 0.0015,
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
}

/// Maximise the likelihood from a start.
///
/// With `blocks` the covariance is block-wise, without them it is the model's: the inverse
/// Gauss–Newton information with the structure eliminated, at the estimated structure.
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
    let mut search = Search { phi: *start, scale2: 1.0 };
    let stride = observations.len() / COARSE;
    if stride > 1 {
        let few: Vec<M> = observations.iter().step_by(stride).copied().collect();
        search.begin(&few, rig, kernel)?;
        // Few observations may leave open what all determine.
        search = search.settle(&few, rig, None, kernel).map_or(search, |(found, _)| found);
    } else {
        search.begin(observations, rig, kernel)?;
    }
    let (found, sums) = search.settle(observations, rig, blocks, kernel)?;
    finish(&found, &sums, observations.len(), blocks)
}

/// About so many observations bring the iteration near its end before all of them are used.
const COARSE: usize = 4096;

/// Where the iteration is.
#[derive(Debug, Clone, Copy)]
struct Search {
    phi: Twist,
    /// Squared scale of the misclosures in units of their stated covariance.
    scale2: f64,
}

impl Search {
    /// A robust first scale.
    fn begin<M: Measurement>(
        &mut self,
        observations: &[M],
        rig: &StereoRig,
        kernel: &StudentT,
    ) -> Result<(), Unsolvable> {
        if kernel.nu.is_finite() {
            self.scale2 = robust_scale2(observations, &self.phi, rig)
                .ok_or(Unsolvable::FewRows { rows: 0, needed: 3 })?;
        }
        Ok(())
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
        for _ in 0..kernel.iterations {
            let at = At::new(self.phi, rig);
            let weighing = Weighing { blocks, kernel, scale2: self.scale2 };
            let sums = Sums::over(observations, &mut structures, &at, &weighing);
            let step = &sums.whole;
            if step.used < 3 {
                return Err(Unsolvable::FewRows { rows: step.used, needed: 3 });
            }
            let delta = direction(step)?;
            self.phi = Twist::from_vector(&(self.phi.vector() + delta));
            if kernel.nu.is_finite() {
                self.scale2 = step.scale2().max(LEAST_SCALE2);
            }
            let moved = delta.dot(&(step.score.information * delta)).max(0.0).sqrt();
            // Steps that shrink by a factor are followed by ones that sum up to this.
            let factor = (moved / last).min(0.5);
            let rest = moved * factor / (1.0 - factor);
            last = moved;
            if rest <= kernel.tolerance * self.scale2.sqrt() {
                return Ok((self, sums));
            }
        }
        Err(Unsolvable::NotConverged)
    }
}

/// The step of φ: Newton's, with the weights' own change, near the end; Gauss–Newton's elsewhere.
fn direction(step: &Step) -> Result<Vector6<f64>, Unsolvable> {
    let (information, score) = (&step.score.information, &step.score.score);
    let observability = Observability::of(information)?;
    let plain = observability.solve(information, score)?;
    if observability.rank() < 6 {
        return Ok(plain);
    }
    let newton = step.bread().cholesky().map(|bread| bread.solve(score));
    // Far from the end the likelihood may be flat in some direction, and Newton's step too long.
    let length = |v: &Vector6<f64>| v.dot(&(information * v));
    Ok(newton.filter(|newton| length(newton) <= LONGEST.powi(2) * length(&plain)).unwrap_or(plain))
}

/// Newton's step is taken unless so many times as long as Gauss–Newton's.
const LONGEST: f64 = 3.0;

/// A robust first scale of q: its median over that of χ²₃, with the structure as measured.
pub(super) fn robust_scale2<M: Measurement>(observations: &[M], phi: &Twist, rig: &StereoRig) -> Option<f64> {
    let at = At::new(*phi, rig);
    let mut squares: Vec<f64> = observations.iter().filter_map(|o| sampson(o, &at)).collect();
    (!squares.is_empty()).then(|| (median(&mut squares) / 2.366).max(LEAST_SCALE2))
}

/// q with the structure held at its measured value (the Sampson form).
fn sampson<M: Measurement>(observation: &M, at: &At<'_>) -> Option<f64> {
    let l = observation.linearise(&mut observation.structure(), at)?;
    Some(l.misclosure.dot(&(l.inverse_cov * l.misclosure)))
}

/// The answer from the sums of the last step, which was less than the tolerance.
fn finish(
    found: &Search,
    sums: &Sums,
    rows: usize,
    blocks: Option<&Blocks>,
) -> Result<MaximumLikelihood, Unsolvable> {
    let whole = &sums.whole;
    let observability = Observability::of(&whole.score.information)?;
    let cov = match blocks {
        Some(_) => {
            let scores: Vec<BlockScore<6>> = sums.by_block.iter().map(|step| step.score).collect();
            blocks::covariance(&scores, whole.bread().try_inverse().as_ref(), &observability)
        }
        None => blocks::model_covariance(1.0, &observability),
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
    })
}

/// A robust start for tracks: the three-point alignment, or the prior, with the least median of q.
///
/// # Errors
/// [`Unsolvable`] with fewer than four tracks or when no subset determines a motion.
pub fn robust_start(
    tracks: &[StereoTrack],
    rig: &StereoRig,
    prior: Option<&Twist>,
    options: &MaximumLikelihoodOptions,
) -> Result<Twist, Unsolvable> {
    let stride = tracks.len().div_ceil(options.start_observations.max(4)).max(1);
    let sample: Vec<StereoTrack> = tracks.iter().step_by(stride).copied().collect();
    let pairs: Vec<PointPair> =
        sample.iter().filter_map(|track| PointPair::from_track(track, rig, 0)).collect();
    if pairs.len() < 4 {
        return Err(Unsolvable::FewRows { rows: pairs.len(), needed: 4 });
    }
    let count = trials(options.confidence, options.outliers, 3);
    let subsets: Vec<[usize; 3]> = random_subsets::<3>(pairs.len(), count, options.seed).collect();
    let candidates = subsets.iter().filter_map(|subset| {
        let alignment = Moments::over(subset.iter().map(|&i| (&pairs[i], 1.0))).align(Form::Rigid)?;
        Some(alignment.motion()?.log())
    });
    let candidates: Vec<Twist> = candidates.chain(prior.copied()).collect();
    let stride = (sample.len() / FIRST_LOOK).max(1);
    let glance: Vec<StereoTrack> = sample.iter().step_by(stride).copied().collect();
    let finalists = best(&candidates, FINALISTS, &glance, rig);
    best(&finalists, 1, &sample, rig).first().copied().ok_or(Unsolvable::Unobservable)
}

/// Candidates are first judged on about so many observations,
const FIRST_LOOK: usize = 100;
/// and so many of them on all.
const FINALISTS: usize = 12;

/// The `count` candidates with the least median of q, the best first.
fn best(candidates: &[Twist], count: usize, sample: &[StereoTrack], rig: &StereoRig) -> Vec<Twist> {
    let judge = |phi: &Twist| (robust_scale2(sample, phi, rig).unwrap_or(f64::INFINITY), *phi);
    let mut judged: Vec<(f64, Twist)> = candidates.par_iter().map(judge).collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0));
    judged.into_iter().take(count).map(|(_, phi)| phi).collect()
}

/// The inverse Fisher information of φ at a known motion and structure: no unbiased estimator does better.
///
/// `None` when some direction is not determined.
pub fn cramer_rao_bound<M: Measurement>(
    observations: &[M],
    rig: &StereoRig,
    phi: &Twist,
) -> Option<Matrix6<f64>> {
    let at = At::new(*phi, rig);
    let gaussian = StudentT { nu: f64::INFINITY, ..StudentT::default() };
    let mut structures: Vec<Vector3<f64>> = observations.iter().map(Measurement::structure).collect();
    let weighing = Weighing { blocks: None, kernel: &gaussian, scale2: 1.0 };
    let sums = Sums::over(observations, &mut structures, &at, &weighing);
    let observability = Observability::of(&sums.whole.score.information).ok()?;
    let observed: [bool; 6] = observability.observed();
    observed.iter().all(|&o| o).then(|| blocks::model_covariance(1.0, &observability))
}
