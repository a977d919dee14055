//! What a linear estimator found, and its covariance.

use nalgebra::{SMatrix, SVector};

use super::row::Row;
use crate::estimate::certainty::blocks::BlockScore;
use crate::estimate::certainty::covariance::covariance;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::motion_estimate::Estimate;
use crate::geometry::Gaussian;

/// What a linear estimator found: θ̂, the weight it gave each row, and how well θ̂ is determined.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearFit<const N: usize> {
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

impl<const N: usize> LinearFit<N> {
    /// The estimate with its block-wise covariance; `rows` are those that were fitted.
    pub fn estimate(&self, rows: &[Row<N>]) -> Estimate<N> {
        debug_assert_eq!(rows.len(), self.weights.len(), "these are not the rows that were fitted");
        let count = rows.iter().map(|row| row.block + 1).max().unwrap_or(0);
        let mut scores = vec![BlockScore::<N>::default(); count];
        for (row, &weight) in rows.iter().zip(&self.weights) {
            let block = &mut scores[row.block];
            block.information += weight * row.a * row.a.transpose();
            block.score += weight * row.residual(&self.theta) * row.a;
        }
        let inverse = self.bread.and_then(|bread| bread.try_inverse());
        let cov = covariance(&scores, inverse.as_ref(), &self.observability);
        Estimate {
            theta: Gaussian { mean: self.observability.with_unobserved_zero(&self.theta), cov },
            observed: self.observability.observed(),
            undetermined: self.observability.undetermined(),
            rows: rows.len(),
            inliers: self.inliers,
            residual_scale: self.residual_scale,
        }
    }
}
