//! A step of maximum likelihood's iteration: its direction, its damping, and whether it is taken back.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::score_sums::{FrameSums, ScoreSums};
use crate::estimate::certainty::observability::Observability;
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::Twist;

/// Newton's step is taken unless it is this many times as long as Gauss–Newton's: far from the end the likelihood may
/// be flat in some direction, and Newton's step too long.
const LONGEST_NEWTON_STEP: f64 = 3.0;
/// A step is taken back when the cost per observation rises by more than this: structures, which lag a step behind
/// φ, change it by less.
const COST_SLACK: f64 = 3e-3;
/// The first damping after a step by which the likelihood fell, as a share of the information's diagonal.
const LEAST_DAMPING: f64 = 0.1;
/// Damping grows no further than this: steps are then a thousandth of Gauss–Newton's.
const MOST_DAMPING: f64 = 1e3;
/// Damping grows by this factor with each step that is taken back, and falls by it with each that is not.
const DAMPING_GROWTH: f64 = 10.0;

/// The damping after a step that is taken back.
pub(super) fn more(damping: f64) -> f64 {
    (damping * DAMPING_GROWTH).clamp(LEAST_DAMPING, MOST_DAMPING)
}

/// The damping after one that is not.
pub(super) fn less(damping: f64) -> f64 {
    if damping > LEAST_DAMPING { damping / DAMPING_GROWTH } else { 0.0 }
}

/// The φ of the last step that was not taken back, with its sums.
pub(super) struct Accepted {
    pub(super) phi: Twist,
    pub(super) structures: Vec<Vector3<f64>>,
    pub(super) cost: f64,
    pub(super) sums: FrameSums,
}

impl Accepted {
    /// Whether a step from here to a place of this cost and these sums is to be taken back.
    ///
    /// The score takes the covariance of misclosures as constant, but it changes a little with φ. So the cost may rise near
    /// the end, although the score comes nearer to zero there.
    pub(super) fn is_better_than(&self, cost: f64, there: &ScoreSums) -> bool {
        let here = &self.sums.whole;
        let rises = cost > self.cost + COST_SLACK * there.used as f64;
        let nearer = || there.used >= here.used && there.way_left() < here.way_left();
        !cost.is_finite() || (rises && !nearer())
    }

    /// The motion that a step from here leads to.
    pub(super) fn stepped(&self, delta: &Vector6<f64>) -> Twist {
        Twist::from_vector(&(self.phi.vector() + delta))
    }
}

/// The step of φ: Newton's, with the weights' own change, near the end; Gauss–Newton's elsewhere.
///
/// `damping` adds that share of its own diagonal to the information.
pub(super) fn direction(step: &ScoreSums, newton: bool, damping: f64) -> Result<Vector6<f64>, Unsolvable> {
    let (information, score) = (&step.score.information, &step.score.score);
    if damping > 0.0 {
        let damped = information + Matrix6::from_diagonal(&(information.diagonal() * damping));
        return Observability::of(&damped)?.solve(&damped, score);
    }
    let observability = Observability::of(information)?;
    let plain = observability.solve(information, score)?;
    if observability.rank() < 6 || !newton {
        return Ok(plain);
    }
    let newton = step.bread().cholesky().map(|bread| bread.solve(score));
    let length = |v: &Vector6<f64>| v.dot(&(information * v));
    Ok(newton
        .filter(|newton| length(newton) <= LONGEST_NEWTON_STEP.powi(2) * length(&plain))
        .unwrap_or(plain))
}
