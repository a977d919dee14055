//! Maximum likelihood in the measured quantities, over φ and every point's true position at once.
//!
//! Each observation has three equations f(measured, φ) = 0 after its own structure is eliminated.
//! With e their misclosure linearised at the current structure, S its covariance and G its
//! derivative by φ, Gauss–Newton solves Σ Gᵀ S⁻¹ G δ = Σ Gᵀ S⁻¹ e; a zero variance before the
//! motion is legal because S, never the measurement's covariance alone, is inverted. Robust
//! weights are those of Student's t on q = eᵀ S⁻¹ e.

use nalgebra::{Matrix6, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::alignment::{Form, Moments, PointPair};
use super::blocks::{self, BlockScore, Blocks};
use super::lmeds::{random_subsets, trials};
use super::m_estimator::{LEAST_SCALE2, StudentT};
use super::measurement::{At, Linearised, Measurement, product};
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

/// The sums of one Gauss–Newton step.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    score: BlockScore<6>,
    bread: Matrix6<f64>,
    weighted_square: f64,
    square: f64,
    used: usize,
    inliers: usize,
}

impl Step {
    fn add(&mut self, l: &Linearised, kernel: &StudentT, scale2: f64) {
        let inverse = l.inverse_cov;
        let q = l.misclosure.dot(&(inverse * l.misclosure));
        let weight = kernel.weight(q / scale2, 3.0);
        let weighted = product(&l.by_phi.transpose(), &inverse);
        let (information, score) = (product(&weighted, &l.by_phi), product(&weighted, &l.misclosure));
        self.score.information += weight * information;
        self.score.score += weight * score;
        self.bread += weight * information
            - kernel.curvature(q / scale2, 3.0) / scale2 * product(&score, &score.transpose());
        self.weighted_square += weight * q;
        self.square += q;
        self.used += 1;
        self.inliers += usize::from(q <= INLIER_Q * scale2);
    }

    fn merged(mut self, other: &Self) -> Self {
        self.score.information += other.score.information;
        self.score.score += other.score.score;
        self.bread += other.bread;
        self.weighted_square += other.weighted_square;
        self.square += other.square;
        self.used += other.used;
        self.inliers += other.inliers;
        self
    }
}

/// Squared misclosure, in units of its scaled covariance, beyond which an observation is no inlier: χ²₃(0.99).
const INLIER_Q: f64 = 11.345;

/// Observations handled by one task; fixed, so that sums do not depend on the number of threads.
const STRIP: usize = 512;

/// A maximum-likelihood estimate with what tests and studies ask of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaximumLikelihood {
    /// φ̂ with its covariance.
    pub motion: MotionEstimate,
    /// Σ eᵀ S⁻¹ e at the estimate, without robust weights.
    pub cost: f64,
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
    let mut structures: Vec<Vector3<f64>> = observations.iter().map(Measurement::structure).collect();
    let mut phi = *start;
    let mut scale2 = if kernel.nu.is_infinite() {
        1.0
    } else {
        robust_scale2(observations, &phi, rig).ok_or(Unsolvable::FewRows { rows: 0, needed: 3 })?
    };
    for _ in 0..kernel.iterations {
        let at = At::new(phi, rig);
        let step = sums(observations, &mut structures, &at, kernel, scale2);
        if step.used < 3 {
            return Err(Unsolvable::FewRows { rows: step.used, needed: 3 });
        }
        let observability = Observability::of(&step.score.information)?;
        let delta = observability.solve(&step.score.information, &step.score.score)?;
        phi = Twist::from_vector(&(phi.vector() + delta));
        if !kernel.nu.is_infinite() {
            scale2 = (step.weighted_square / (3 * step.used) as f64).max(LEAST_SCALE2);
        }
        let moved = delta.dot(&(step.score.information * delta)).max(0.0).sqrt();
        if moved <= kernel.tolerance * scale2.sqrt() {
            return finish(observations, &mut structures, &At::new(phi, rig), blocks, kernel, scale2);
        }
    }
    Err(Unsolvable::NotConverged)
}

fn sums<M: Measurement>(
    observations: &[M],
    structures: &mut [Vector3<f64>],
    at: &At<'_>,
    kernel: &StudentT,
    scale2: f64,
) -> Step {
    let strips: Vec<Step> = observations
        .par_chunks(STRIP)
        .zip(structures.par_chunks_mut(STRIP))
        .map(|(observations, structures)| {
            let mut step = Step::default();
            for (observation, structure) in observations.iter().zip(structures) {
                if let Some(l) = observation.linearise(structure, at) {
                    step.add(&l, kernel, scale2);
                }
            }
            step
        })
        .collect();
    strips.iter().fold(Step::default(), Step::merged)
}

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

fn finish<M: Measurement>(
    observations: &[M],
    structures: &mut [Vector3<f64>],
    at: &At<'_>,
    blocks: Option<&Blocks>,
    kernel: &StudentT,
    scale2: f64,
) -> Result<MaximumLikelihood, Unsolvable> {
    let mut per_block = vec![Step::default(); blocks.map_or(1, Blocks::count)];
    for (observation, structure) in observations.iter().zip(structures) {
        let (x, y) = observation.position();
        if let Some(l) = observation.linearise(structure, at) {
            per_block[blocks.map_or(0, |b| b.index(x, y))].add(&l, kernel, scale2);
        }
    }
    let whole = per_block.iter().fold(Step::default(), Step::merged);
    let observability = Observability::of(&whole.score.information)?;
    let cov = match blocks {
        Some(_) => {
            let scores: Vec<BlockScore<6>> = per_block.iter().map(|step| step.score).collect();
            blocks::covariance(&scores, whole.bread.try_inverse().as_ref(), &observability)
        }
        None => blocks::model_covariance(1.0, &observability),
    };
    let freedom = (3 * whole.used).saturating_sub(6).max(1) as f64;
    Ok(MaximumLikelihood {
        motion: Estimate {
            theta: Gaussian { mean: observability.known(&at.phi.vector()), cov },
            observed: observability.observed(),
            rows: observations.len(),
            inliers: whole.inliers,
            residual_scale: (whole.weighted_square / freedom).sqrt(),
        },
        cost: whole.square,
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
    let step = sums(observations, &mut structures, &at, &gaussian, 1.0);
    let observability = Observability::of(&step.score.information).ok()?;
    let observed: [bool; 6] = observability.observed();
    observed.iter().all(|&o| o).then(|| blocks::model_covariance(1.0, &observability))
}
