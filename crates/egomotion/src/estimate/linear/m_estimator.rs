//! Robust regression by iteratively reweighted least squares with Student's t.

use documented::DocumentedFields;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use crate::estimate::{Fit, NormalEquations, Row, Unsolvable, median};

/// Student's t as the distribution of residuals: heavy tails instead of a cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct StudentT {
    /// Degrees of freedom ν; small is heavy-tailed, infinite is Gaussian.
    pub nu: f64,
    /// Whether maximum likelihood finds ν, and a share of outliers, from the residuals; see [`crate::estimate::likelihood::mixture`].
    ///
    /// Linear rows keep `nu`, and so does the Gaussian.
    pub fitted: bool,
    /// Most iterations.
    pub iterations: usize,
    /// The iteration ends when no unknown moves by more than this share of its standard deviation.
    pub tolerance: f64,
}

impl Default for StudentT {
    fn default() -> Self {
        Self { nu: 4.0, fitted: true, iterations: 50, tolerance: 1e-3 }
    }
}

impl StudentT {
    /// Weight of a residual of `dimension` components whose squared Mahalanobis length is `q`.
    pub fn weight(&self, q: f64, dimension: f64) -> f64 {
        if self.nu.is_infinite() { 1.0 } else { (self.nu + dimension) / (self.nu + q) }
    }

    /// −2 ∂weight/∂q, which turns the weighted information into the score's true derivative.
    pub fn curvature(&self, q: f64, dimension: f64) -> f64 {
        if self.nu.is_infinite() {
            0.0
        } else {
            2.0 * self.weight(q, dimension).powi(2) / (self.nu + dimension)
        }
    }
}

/// Least squared scale of residuals in units of σ: what exact observations leave below it are rounding errors,
/// which have no scale that an iteration could settle at.
pub(crate) const LEAST_SCALE2: f64 = 1e-12;

/// Squared residual, in units of the scaled σ, beyond which a row is no inlier: χ²₁(0.99).
const INLIER_Q: f64 = 6.635;

/// θ by iteratively reweighted least squares of rows in units of their σ, from a start.
///
/// The scale of the residuals is estimated along (EM), so a common factor in all σ does not matter.
///
/// # Errors
/// [`Unsolvable`] with too few rows, without any determined direction, or when it does not settle.
pub fn m_estimate<const N: usize>(
    rows: &[Row<N>],
    start: &SVector<f64, N>,
    kernel: &StudentT,
) -> Result<Fit<N>, Unsolvable> {
    let standard = |row: &Row<N>, theta: &SVector<f64, N>| row.residual(theta) / row.sigma;
    let mut theta = *start;
    let mut absolute: Vec<f64> = rows.iter().map(|row| standard(row, &theta).abs()).collect();
    let mut scale2 = (1.4826 * median(&mut absolute)).powi(2).max(LEAST_SCALE2);
    let mut weights = vec![0.0; rows.len()];
    for _ in 0..kernel.iterations {
        let mut sum = 0.0;
        for (row, weight) in rows.iter().zip(&mut weights) {
            let r2 = standard(row, &theta).powi(2);
            let w = kernel.weight(r2 / scale2, 1.0);
            sum += w * r2;
            *weight = w / (row.sigma * row.sigma);
        }
        scale2 = (sum / rows.len().saturating_sub(N).max(1) as f64).max(LEAST_SCALE2);
        let equations = NormalEquations::over(rows.iter().zip(weights.iter().copied()));
        let (next, observability) = equations.solve()?;
        let moved = (next - theta).component_mul(&equations.information.diagonal().map(f64::sqrt)).amax();
        theta = next;
        if moved <= kernel.tolerance * scale2.sqrt() {
            let inliers =
                rows.iter().filter(|row| standard(row, &theta).powi(2) <= INLIER_Q * scale2).count();
            return Ok(Fit {
                theta,
                bread: Some(bread(rows, &theta, scale2, kernel)),
                weights,
                observability,
                inliers,
                residual_scale: scale2.sqrt(),
            });
        }
    }
    Err(Unsolvable::NotConverged)
}

/// The derivative of the total score by θ.
fn bread<const N: usize>(
    rows: &[Row<N>],
    theta: &SVector<f64, N>,
    scale2: f64,
    kernel: &StudentT,
) -> SMatrix<f64, N, N> {
    rows.iter()
        .map(|row| {
            let variance = scale2 * row.sigma * row.sigma;
            let q = row.residual(theta).powi(2) / variance;
            let slope = kernel.weight(q, 1.0) - kernel.curvature(q, 1.0) * q;
            slope / (row.sigma * row.sigma) * row.a * row.a.transpose()
        })
        .sum()
}
