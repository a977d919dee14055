//! The answer of every estimator: θ̂ with its covariance, and which of it was observed.

use nalgebra::{Matrix6, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use super::certainty::covariance::with_unobserved;
use super::certainty::undetermined::UndeterminedDirections;
use super::serde_array;
use super::unsolvable::Unsolvable;
use crate::geometry::{CayleyMotion, Gaussian, Twist};

/// An unknown is as free as another of which it takes this share: less is of second order in a motion, beside its size.
const LEAST_PART: f64 = 1e-3;

/// The answer of an estimator of N unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate<const N: usize> {
    /// θ̂ and its covariance; an unobserved component is NaN, of infinite variance.
    pub theta: Gaussian<N>,
    /// Which components are determined by the data.
    #[serde(with = "serde_array")]
    pub observed: [bool; N],
    /// The directions that are not; for φ, what they are in words.
    pub undetermined: UndeterminedDirections<N>,
    /// Number of rows (or observations) that went in.
    pub rows: usize,
    /// Number of rows that the estimator kept as inliers.
    pub inliers: usize,
    /// Scale of the residuals: in units of each row's σ where rows are weighted, else in the rows' own unit.
    pub residual_scale: f64,
}

/// φ of the left camera with its covariance, order (tX, tY, tZ, ΩX, ΩY, ΩZ), metres and radians per interval.
pub type MotionEstimate = Estimate<6>;

impl<const N: usize> Estimate<N> {
    /// Whether every component is determined.
    pub fn is_complete(&self) -> bool {
        self.observed.iter().all(|&o| o)
    }
}

impl MotionEstimate {
    /// φ̂; NaN where it is not observed.
    pub fn phi(&self) -> Twist {
        Twist::from_vector(&self.theta.mean)
    }

    /// φ̂ with 0 for each component that is not observed: for where a number must stand, as in a chain of poses.
    pub fn phi_or_zero(&self) -> Twist {
        Twist::from_vector(&Vector6::from_fn(|i, _| if self.observed[i] { self.theta.mean[i] } else { 0.0 }))
    }

    /// How far φ̂ is from another motion, in standard deviations of the component that is furthest.
    pub(crate) fn moved_from(&self, other: &Twist) -> f64 {
        let step = self.theta.mean - other.vector();
        (0..6).map(|i| (step[i] / self.theta.sigma(i)).abs()).fold(0.0, f64::max)
    }

    /// The estimate with its components of unbounded variance marked as unobserved.
    ///
    /// # Errors
    /// [`Unsolvable::Unobservable`] when none is left.
    pub fn with_unbounded_unobserved(mut self) -> Result<Self, Unsolvable> {
        for i in 0..6 {
            if self.observed[i] && !self.theta.cov[(i, i)].is_finite() {
                self.observed[i] = false;
                self.undetermined = self.undetermined.with_components([i]);
            }
            if !self.observed[i] {
                self.theta.mean[i] = f64::NAN;
            }
        }
        let any = self.observed.contains(&true);
        self.theta.cov = with_unobserved(self.theta.cov, &self.observed);
        if any { Ok(self) } else { Err(Unsolvable::Unobservable) }
    }

    /// The same motion and covariance seen by a parallel camera centred at `centre`, equation (4).
    pub fn seen_from(&self, centre: &Vector3<f64>) -> Self {
        let matrix = Twist::seen_from_matrix(centre);
        self.transformed(matrix * self.phi_or_zero().vector(), &matrix)
    }

    /// φ where the unknowns were (τ, w) of [`CayleyMotion`].
    pub(crate) fn into_phi(self) -> Self {
        let cayley = CayleyMotion::from_vector(&self.phi_or_zero().vector());
        self.transformed(cayley.twist().vector(), &cayley.twist_jacobian())
    }

    /// The estimate of other unknowns, of value `mean` and derivative `jacobian` by these.
    ///
    /// An unknown that takes more than [`LEAST_PART`] of one that is not observed is not observed either.
    fn transformed(&self, mean: Vector6<f64>, jacobian: &Matrix6<f64>) -> Self {
        let free = |i: usize| (0..6).any(|j| !self.observed[j] && jacobian[(i, j)].abs() > LEAST_PART);
        let observed: [bool; 6] = std::array::from_fn(|i| !free(i));
        let finite = Matrix6::from_fn(|i, j| {
            let known = self.observed[i] && self.observed[j];
            if known { self.theta.cov[(i, j)] } else { 0.0 }
        });
        let known = Gaussian { mean: self.theta.mean, cov: finite }.propagate(mean, jacobian);
        let mean = Vector6::from_fn(|i, _| if observed[i] { known.mean[i] } else { f64::NAN });
        Self {
            theta: Gaussian { mean, cov: with_unobserved(known.cov, &observed) },
            observed,
            undetermined: self.undetermined.transformed(jacobian),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_finite_variance_is_not_observed() {
        let estimate = |variances: [f64; 6]| Estimate {
            theta: Gaussian::independent([1.0; 6], variances),
            observed: [true; 6],
            undetermined: UndeterminedDirections::default(),
            rows: 10,
            inliers: 10,
            residual_scale: 1.0,
        };
        let known =
            estimate([1.0, f64::INFINITY, 1.0, 1.0, f64::NAN, 1.0]).with_unbounded_unobserved().unwrap();
        assert_eq!(known.observed, [true, false, true, true, false, true]);
        assert_eq!(known.theta.mean.map(f64::is_nan).as_slice(), &[false, true, false, false, true, false]);
        assert_eq!(known.phi_or_zero().vector().as_slice(), &[1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
        assert_eq!(known.theta.cov[(4, 4)], f64::INFINITY);
        assert_eq!(estimate([f64::INFINITY; 6]).with_unbounded_unobserved(), Err(Unsolvable::Unobservable));
    }
}
