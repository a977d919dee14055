//! The sums over all observations from which maximum likelihood makes one Gauss–Newton step.

use nalgebra::{Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use super::mixture::ResidualModel;
use crate::constrain::{LinearisationPoint, Measurement, Misclosure};
use crate::estimate::certainty::blocks::{BlockScore, Blocks};
use crate::estimate::certainty::observability::Observability;
use crate::geometry::distribution::CHI2_3_P99;
use crate::geometry::gaussian::{accumulate, product};
use crate::geometry::{StereoRig, Twist, median};
use crate::observe::{StereoFlow, StereoTrack};
use crate::simd::vectorised;

/// Squared misclosure, in units of its scaled covariance, beyond which an observation is no inlier.
const INLIER_Q: f64 = CHI2_3_P99;
/// Squared misclosure, in units of its scaled covariance, that counts for a point which a motion leads behind the camera:
/// no motion gains by losing points.
const UNUSABLE_Q: f64 = 1e6;
/// Observations handled by one task; fixed, so that sums do not depend on the number of threads.
const STRIP: usize = 512;

/// Sums over observations, by φ.
#[derive(Debug, Clone, Copy, Default)]
pub struct ScoreSums {
    /// Σ w Gᵀ S⁻¹ G and Σ w Gᵀ S⁻¹ e.
    pub(crate) score: BlockScore<6>,
    /// By how much the score's true derivative is less than the information, because weights change as well.
    reweighting: Matrix6<f64>,
    /// Σ w.
    weights: f64,
    /// Σ w q.
    pub(crate) weighted_square: f64,
    /// Σ w² q.
    score_square: f64,
    /// Σ −2 (∂w/∂q) q, with q in its own units.
    falling_off: f64,
    /// Σ q.
    pub(crate) square: f64,
    /// Σ of the residual model's cost, and of [`UNUSABLE_Q`] for each observation that is not in front of the camera.
    cost: f64,
    /// Number of observations in front of the camera.
    pub(crate) used: usize,
    /// Number of observations that fit.
    pub(crate) inliers: usize,
}

/// How observations are weighed and grouped.
#[derive(Debug, Clone, Copy)]
pub struct Weighing<'a> {
    /// Blocks whose sums are wanted; without them all is one block.
    pub(crate) blocks: Option<&'a Blocks>,
    /// Whether an observation lies in the block where the later frame shows it, not the earlier one.
    pub(crate) in_later: bool,
    /// How misclosures are distributed.
    pub(crate) residuals: ResidualModel,
}

impl ScoreSums {
    /// Derivative of the score by φ, with the robust weights' own.
    pub(crate) fn bread(&self) -> Matrix6<f64> {
        self.score.information - self.reweighting
    }

    /// The next squared scale of the misclosures in units of their stated covariance.
    ///
    /// Σ w is the number of observations once the scale has settled; to divide by it in place of that
    /// number makes few iterations of many (PX-EM: Liu, Rubin and Wu 1998).
    pub(crate) fn scale2(&self) -> f64 {
        self.weighted_square / (3.0 * self.weights)
    }

    /// −2 ln of the likelihood at the linearisation, beside a constant, of misclosures of the given squared scale.
    pub(crate) fn cost(&self, scale2: f64) -> f64 {
        self.cost + 3.0 * self.used as f64 * scale2.ln()
    }

    /// Length of Gauss–Newton's step, in units of its own standard deviation; infinite where no step is determined.
    pub(crate) fn way_left(&self) -> f64 {
        let BlockScore { information, score } = &self.score;
        let step = Observability::of(information).and_then(|found| found.solve(information, score));
        step.map_or(f64::INFINITY, |step| step.dot(score).max(0.0).sqrt())
    }

    /// Factor from the inverse of Σ w Gᵀ S⁻¹ G to the covariance, where residuals are independent and spherical.
    ///
    /// The sandwich B⁻¹ M B⁻¹, of which M = Σ w² q/3 Gᵀ S⁻¹ G and B = Σ (w + 2 q ∂w/∂q/3) Gᵀ S⁻¹ G are taken as
    /// multiples of the information (Huber's proposal); the residuals of few observations are short by those of φ.
    pub(crate) fn spread(&self) -> f64 {
        let meat = self.score_square / (3.0 * self.weights);
        let bread = 1.0 - self.falling_off / (3.0 * self.weights);
        let residuals = (3 * self.used) as f64;
        meat / (bread * bread) * residuals / (residuals - 6.0).max(1.0)
    }

    #[inline(always)]
    fn add(&mut self, l: &Misclosure, weighing: &Weighing<'_>) {
        let ResidualModel { mixture, scale2 } = weighing.residuals;
        let pull = product(&l.inverse_cov, &l.e);
        let q = l.e.dot(&pull);
        let (weight, slope) = mixture.weight(q / scale2);
        let weighted = product(&l.motion_jacobian.transpose(), &(l.inverse_cov * weight));
        let unweighted: Vector6<f64> = product(&l.motion_jacobian.transpose(), &pull);
        accumulate(&mut self.score.information, &weighted, &l.motion_jacobian);
        accumulate(&mut self.score.score, &weighted, &l.e);
        let change = weight * slope / scale2;
        accumulate(&mut self.reweighting, &(unweighted * change), &unweighted.transpose());
        self.weights += weight;
        self.weighted_square += weight * q;
        self.score_square += weight * weight * q;
        self.falling_off += change * q;
        self.square += q;
        self.cost += mixture.cost(q / scale2);
        self.used += 1;
        self.inliers += usize::from(q <= INLIER_Q * scale2);
    }

    fn merged(mut self, other: &Self) -> Self {
        self.score.information += other.score.information;
        self.score.score += other.score.score;
        self.reweighting += other.reweighting;
        self.weights += other.weights;
        self.weighted_square += other.weighted_square;
        self.score_square += other.score_square;
        self.falling_off += other.falling_off;
        self.square += other.square;
        self.cost += other.cost;
        self.used += other.used;
        self.inliers += other.inliers;
        self
    }

    /// Sums by the small motion δ of a measurement as sums by φ.
    fn by_phi(mut self, jacobian: &Matrix6<f64>) -> Self {
        let across = jacobian.transpose();
        self.score.information = across * self.score.information * jacobian;
        self.score.score = across * self.score.score;
        self.reweighting = across * self.reweighting * jacobian;
        self
    }
}

/// Sums of consecutive observations, each with the block in which they lie.
type BlockRuns = Vec<(usize, ScoreSums)>;

/// The sums of one step: of each block, and of all observations.
#[derive(Debug, Clone)]
pub(crate) struct FrameSums {
    pub(crate) by_block: Vec<ScoreSums>,
    pub(crate) whole: ScoreSums,
}

impl FrameSums {
    /// Linearise about a motion and sum; structures are improved.
    pub(crate) fn linearised<M: LikelihoodTerm>(
        observations: &[M],
        structures: &mut [Vector3<f64>],
        at: &LinearisationPoint<'_>,
        weighing: &Weighing<'_>,
    ) -> Self {
        debug_assert_eq!(observations.len(), structures.len(), "each observation has one structure");
        debug_assert!(weighing.residuals.scale2 > 0.0, "weights are by residuals in units of their scale");
        let strips: Vec<BlockRuns> = observations
            .par_chunks(STRIP)
            .zip(structures.par_chunks_mut(STRIP))
            .map(|(observations, structures)| M::sums(observations, structures, at, weighing))
            .collect();
        let mut by_block = vec![ScoreSums::default(); weighing.blocks.map_or(1, Blocks::count)];
        for (block, step) in strips.iter().flatten() {
            by_block[*block] = by_block[*block].merged(step);
        }
        let jacobian = M::small_motion_jacobian(at);
        by_block.iter_mut().for_each(|step| *step = step.by_phi(&jacobian));
        let whole = by_block.iter().fold(ScoreSums::default(), ScoreSums::merged);
        Self { by_block, whole }
    }
}

/// An observation as a term of the likelihood: a misclosure whose sums over a strip are made by vector kernels.
pub trait LikelihoodTerm: Measurement {
    /// The sums of consecutive observations, one for each run of them that lies in one block.
    fn sums(
        observations: &[Self],
        structures: &mut [Vector3<f64>],
        at: &LinearisationPoint<'_>,
        weighing: &Weighing<'_>,
    ) -> BlockRuns;
}

impl LikelihoodTerm for StereoTrack {
    fn sums(
        observations: &[Self],
        structures: &mut [Vector3<f64>],
        at: &LinearisationPoint<'_>,
        weighing: &Weighing<'_>,
    ) -> BlockRuns {
        of_tracks(observations, structures, at, weighing)
    }
}

impl LikelihoodTerm for StereoFlow {
    fn sums(
        observations: &[Self],
        structures: &mut [Vector3<f64>],
        at: &LinearisationPoint<'_>,
        weighing: &Weighing<'_>,
    ) -> BlockRuns {
        of_flows(observations, structures, at, weighing)
    }
}

vectorised! {
    of_tracks(observations: &[StereoTrack], structures: &mut [Vector3<f64>], at: &LinearisationPoint<'_>, weighing: &Weighing<'_>)
        -> BlockRuns { strip(observations, structures, at, weighing) }
}
vectorised! {
    of_flows(observations: &[StereoFlow], structures: &mut [Vector3<f64>], at: &LinearisationPoint<'_>, weighing: &Weighing<'_>)
        -> BlockRuns { strip(observations, structures, at, weighing) }
}

/// [`LikelihoodTerm::sums`] of observations of any kind.
#[inline(always)]
fn strip<M: Measurement>(
    observations: &[M],
    structures: &mut [Vector3<f64>],
    at: &LinearisationPoint<'_>,
    weighing: &Weighing<'_>,
) -> BlockRuns {
    let mut runs = Vec::new();
    let mut run = (0, ScoreSums::default());
    for (observation, structure) in observations.iter().zip(structures) {
        let (x, y) = if weighing.in_later { observation.later_position() } else { observation.position() };
        let block = weighing.blocks.map_or(0, |blocks| blocks.index(x, y));
        if block != run.0 {
            if run.1.used > 0 {
                runs.push(run);
            }
            run = (block, ScoreSums::default());
        }
        match observation.linearise(structure, at) {
            Some(l) => run.1.add(&l, weighing),
            None => run.1.cost += weighing.residuals.mixture.cost(UNUSABLE_Q),
        }
    }
    runs.push(run);
    runs
}

/// q = eᵀ S⁻¹ e of an observation, with the structure held at its measured value (the Sampson form); `None` behind the
/// camera.
fn square<M: Measurement>(observation: &M, at: &LinearisationPoint<'_>) -> Option<f64> {
    let l = observation.linearise(&mut observation.structure(), at)?;
    Some(l.e.dot(&(l.inverse_cov * l.e)))
}

/// q of every observation in front of the camera.
pub(crate) fn squares<M: Measurement>(observations: &[M], at: &LinearisationPoint<'_>) -> Vec<f64> {
    observations.iter().filter_map(|observation| square(observation, at)).collect()
}

/// The median of q at a motion; infinite without observations, and for each that the motion leads behind the camera.
pub(crate) fn median_square<M: Measurement>(phi: &Twist, sample: &[M], rig: &StereoRig) -> f64 {
    let at = LinearisationPoint::new(*phi, rig);
    let square = |observation: &M| square(observation, &at).unwrap_or(f64::INFINITY);
    let middle = median(&mut sample.iter().map(square).collect::<Vec<f64>>());
    if middle.is_nan() { f64::INFINITY } else { middle }
}
