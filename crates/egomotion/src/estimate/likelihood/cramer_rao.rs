//! The Cramér–Rao bound of φ, and an estimate that reaches it.

use nalgebra::{Matrix6, Vector3};

use super::mixture::{Mixture, ResidualModel};
use super::score_sums::{FrameSums, LikelihoodTerm, Weighing};
use crate::constrain::LinearisationPoint;
use crate::estimate::certainty::blocks::BlockScore;
use crate::estimate::certainty::covariance::model_covariance;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::student_t::StudentT;
use crate::geometry::{Gaussian, StereoRig, Twist};

/// The inverse Fisher information of φ at a known motion and structure: no unbiased estimator does better.
///
/// `None` when some direction is not determined.
pub fn cramer_rao_bound<M: LikelihoodTerm>(
    observations: &[M],
    rig: &StereoRig,
    phi: &Twist,
) -> Option<Matrix6<f64>> {
    let structures: Vec<Vector3<f64>> = observations.iter().map(M::structure).collect();
    Some(efficient(observations, &structures, rig, phi)?.cov)
}

/// What no unbiased estimator does better than: one Gauss–Newton step from the true motion and structures.
///
/// Its covariance is the Cramér–Rao bound, and its error has exactly that covariance as long as the noise has
/// the one it states: estimators are compared with it draw by draw. `None` when some direction is not determined.
pub fn efficient<M: LikelihoodTerm>(
    observations: &[M],
    structures: &[Vector3<f64>],
    rig: &StereoRig,
    phi: &Twist,
) -> Option<Gaussian<6>> {
    let gaussian = StudentT { nu: f64::INFINITY, ..StudentT::default() };
    let residuals = ResidualModel { mixture: Mixture::student(&gaussian), scale2: 1.0 };
    let weighing = Weighing { blocks: None, in_later: false, residuals };
    let sums = FrameSums::linearised(
        observations,
        &mut structures.to_vec(),
        &LinearisationPoint::new(*phi, rig),
        &weighing,
    );
    let BlockScore { information, score } = sums.whole.score;
    let observability = Observability::of(&information).ok()?;
    let observed: [bool; 6] = observability.observed();
    let step = observability.solve(&information, &score).ok()?;
    observed
        .iter()
        .all(|&o| o)
        .then(|| Gaussian { mean: phi.vector() + step, cov: model_covariance(1.0, &observability) })
}
