//! From constraints to φ with its covariance.

pub mod alignment;
mod array;
pub mod certainty;
pub mod likelihood;
pub mod linear;
pub mod measurement;
pub mod sensor;

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::geometry::{Gaussian, Twist};

use certainty::blocks;
pub use certainty::blocks::Blocks;
pub use certainty::observability::Observability;
pub use certainty::undetermined::{FreeMotion, Undetermined};
pub use linear::row::{NormalEquations, Row};
pub use sensor::tolerance::Tolerance;

/// The answer of an estimator of N unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate<const N: usize> {
    /// θ̂ and its covariance; an unobserved component has value 0 and an infinite variance.
    pub theta: Gaussian<N>,
    /// Which components are determined by the data.
    #[serde(with = "array")]
    pub observed: [bool; N],
    /// The directions that are not; for φ, what they are in words.
    pub undetermined: Undetermined<N>,
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
    /// φ̂.
    pub fn phi(&self) -> Twist {
        Twist::from_vector(&self.theta.mean)
    }

    /// How far φ̂ is from another motion, in standard deviations of the component that is furthest.
    pub fn moved_from(&self, other: &Twist) -> f64 {
        let step = self.theta.mean - other.vector();
        (0..6).map(|i| (step[i] / self.theta.sigma(i)).abs()).fold(0.0, f64::max)
    }

    /// The estimate with every component unobserved that has no finite variance.
    ///
    /// # Errors
    /// [`Unsolvable::Unobservable`] when none is left.
    pub fn known(mut self) -> Result<Self, Unsolvable> {
        for i in 0..6 {
            if self.observed[i] && !self.theta.cov[(i, i)].is_finite() {
                self.observed[i] = false;
                self.undetermined = self.undetermined.with_components([i]);
            }
            if !self.observed[i] {
                self.theta.mean[i] = 0.0;
            }
        }
        let any = self.observed.contains(&true);
        self.theta.cov = blocks::with_unknowns(self.theta.cov, &self.observed);
        if any { Ok(self) } else { Err(Unsolvable::Unobservable) }
    }

    /// The same motion and covariance seen by a parallel camera centred at `centre`, equation (4).
    pub fn seen_from(&self, centre: &nalgebra::Vector3<f64>) -> Self {
        let matrix = Twist::seen_from_matrix(centre);
        let theta = self.theta.propagate(matrix * self.theta.mean, &matrix);
        Self { theta, undetermined: self.undetermined.transformed(&matrix), ..*self }
    }
}

/// Why a system of equations has no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error, Serialize, Deserialize)]
pub enum Unsolvable {
    /// Fewer equations than unknowns.
    #[error("{rows} equations for {needed} unknowns")]
    FewRows {
        /// Equations at hand.
        rows: usize,
        /// Equations needed.
        needed: usize,
    },
    /// No direction of motion is determined.
    #[error("no direction of motion is observable")]
    Unobservable,
    /// A number overflowed or was not a number.
    #[error("the equations contain numbers that are not finite")]
    NotFinite,
    /// The iteration did not settle.
    #[error("the estimator did not converge")]
    NotConverged,
}

/// The median; of an even count the mean of the two middle values. NaN for no values. Reorders `values`.
pub fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        upper
    } else {
        let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        0.5 * (lower + upper)
    }
}

/// What a linear estimator found: θ̂, the weight it gave each row, and how well θ̂ is determined.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit<const N: usize> {
    /// θ̂.
    pub theta: SVector<f64, N>,
    /// The weight of each row in the final normal equations; 0 for a rejected one.
    pub weights: Vec<f64>,
    /// Eigen-analysis of the final normal equations.
    pub observability: Observability,
    /// Derivative of the total score by θ where it differs from the weighted information.
    pub bread: Option<SMatrix<f64, N, N>>,
    /// Number of rows kept as inliers.
    pub inliers: usize,
    /// Scale of the residuals, as in [`Estimate::residual_scale`].
    pub residual_scale: f64,
}

impl<const N: usize> Fit<N> {
    /// The estimate with its block-wise covariance; `rows` are those that were fitted.
    pub fn estimate(&self, rows: &[Row<N>]) -> Estimate<N> {
        let count = rows.iter().map(|row| row.block + 1).max().unwrap_or(0);
        let mut scores = vec![blocks::BlockScore::<N>::default(); count];
        for (row, &weight) in rows.iter().zip(&self.weights) {
            let block = &mut scores[row.block];
            block.information += weight * row.a * row.a.transpose();
            block.score += weight * row.residual(&self.theta) * row.a;
        }
        let inverse = self.bread.and_then(|bread| bread.try_inverse());
        let cov = blocks::covariance(&scores, inverse.as_ref(), &self.observability);
        Estimate {
            theta: Gaussian { mean: self.observability.known(&self.theta), cov },
            observed: self.observability.observed(),
            undetermined: self.observability.undetermined(),
            rows: rows.len(),
            inliers: self.inliers,
            residual_scale: self.residual_scale,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_finite_variance_is_not_known() {
        let estimate = |variances: [f64; 6]| Estimate {
            theta: Gaussian::independent([1.0; 6], variances),
            observed: [true; 6],
            undetermined: Undetermined::default(),
            rows: 10,
            inliers: 10,
            residual_scale: 1.0,
        };
        let known = estimate([1.0, f64::INFINITY, 1.0, 1.0, f64::NAN, 1.0]).known().unwrap();
        assert_eq!(known.observed, [true, false, true, true, false, true]);
        assert_eq!(known.theta.mean.as_slice(), &[1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
        assert_eq!(known.theta.cov[(4, 4)], f64::INFINITY);
        assert_eq!(estimate([f64::INFINITY; 6]).known(), Err(Unsolvable::Unobservable));
    }
}
