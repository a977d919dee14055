//! What a linear estimator found, and its covariance.

use nalgebra::{SMatrix, SVector};

use super::row::{NormalEquations, Row};
use crate::estimate::certainty::blocks::BlockScore;
use crate::estimate::certainty::covariance::covariance;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::motion_estimate::Estimate;
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::distribution::SIGMA_PER_MEDIAN_DEVIATION;
use crate::geometry::{Gaussian, median};

/// A direction is determined whose information exceeds that of the coefficients' noise by this many standard deviations:
/// more would call weak directions unobserved, less would let noise pass for information.
pub(super) const DETERMINED_SIGMAS: f64 = 2.5;
/// Variance of what noise adds to the information along a direction, for each row, in units of its mean squared: 2 of
/// a normal number's square, and half as much again since rows two pixels apart share a pixel.
pub(super) const NOISE_VARIANCE: f64 = 3.0;
/// Noise is taken as stated unless most residuals have less than this share of their stated variance: nearer to it, their
/// own scatter would decide.
const CLEARLY_LESS_NOISE: f64 = 0.5;

/// Factor of the stated noise variance where residuals of this scale, in units of their σ, are clearly smaller; else 1.
pub(crate) fn noise_factor(scale: f64) -> f64 {
    if scale * scale < CLEARLY_LESS_NOISE { scale * scale } else { 1.0 }
}

/// [`noise_factor`] of the median residual.
fn noise_scale2<const N: usize>(rows: &[Row<N>], theta: &SVector<f64, N>) -> f64 {
    let standard = |row: &Row<N>| (row.sigma > 0.0).then(|| row.residual(theta).abs() / row.sigma);
    let middle = median(&mut rows.iter().filter_map(standard).collect::<Vec<f64>>());
    noise_factor(SIGMA_PER_MEDIAN_DEVIATION * middle)
}

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
    /// The same fit, but a direction counts as undetermined where the noise of the coefficients alone may determine it;
    /// `noise` is the covariance of the i-th row's coefficients, N×N.
    ///
    /// Noise fills the normal equations up to full rank: along a direction x that no row determines,
    /// xᵀ (Σ w a aᵀ) x is Σ w xᵀ N x, give or take its own scatter. Where residuals are smaller than their σ, so is the
    /// noise.
    ///
    /// # Errors
    /// [`Unsolvable::Unobservable`] when no direction is left.
    pub(crate) fn beyond_noise(
        self,
        rows: &[Row<N>],
        noise: impl Fn(usize) -> SMatrix<f64, N, N>,
    ) -> Result<Self, Unsolvable> {
        let kept = || self.weights.iter().copied().enumerate().filter(|(_, weight)| *weight > 0.0);
        let total: SMatrix<f64, N, N> = kept().map(|(i, weight)| noise(i) * weight).sum();
        let total = total * noise_scale2(rows, &self.theta);
        let scatter = DETERMINED_SIGMAS * (NOISE_VARIANCE / kept().count().max(1) as f64).sqrt();
        let least = |x: &SVector<f64, N>| (1.0 + scatter) * x.dot(&(total * x));
        let observability = self.observability.exceeding(least)?;
        let weighted = rows.iter().zip(self.weights.iter().copied());
        let equations = NormalEquations::of_weighted_rows(weighted);
        let theta = observability.solve(&equations.information, &equations.moment)?;
        Ok(Self { theta, observability, ..self })
    }

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
            theta: Gaussian { mean: self.observability.with_unobserved_nan(&self.theta), cov },
            observed: self.observability.observed(),
            undetermined: self.observability.undetermined(),
            rows: rows.len(),
            inliers: self.inliers,
            residual_scale: self.residual_scale,
        }
    }
}
