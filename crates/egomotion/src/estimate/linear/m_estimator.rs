//! Robust regression by iteratively reweighted least squares with Student's t.

use nalgebra::{SMatrix, SVector};

use super::fit::LinearFit;
use super::row::{NormalEquations, Row};
use crate::estimate::student_t::{LEAST_SCALE2, StudentT};
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::distribution::{CHI2_1_P99, SIGMA_PER_MEDIAN_DEVIATION};
use crate::geometry::median;

/// Squared residual, in units of the scaled σ, beyond which a row is no inlier.
const INLIER_Q: f64 = CHI2_1_P99;

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
) -> Result<LinearFit<N>, Unsolvable> {
    let standard = |row: &Row<N>, theta: &SVector<f64, N>| row.residual(theta) / row.sigma;
    let mut theta = *start;
    let mut absolute: Vec<f64> = rows.iter().map(|row| standard(row, &theta).abs()).collect();
    let mut scale2 = (SIGMA_PER_MEDIAN_DEVIATION * median(&mut absolute)).powi(2).max(LEAST_SCALE2);
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
        let equations = NormalEquations::of_weighted_rows(rows.iter().zip(weights.iter().copied()));
        let (next, observability) = equations.solve()?;
        let moved = (next - theta).component_mul(&equations.information.diagonal().map(f64::sqrt)).amax();
        theta = next;
        if moved <= kernel.tolerance * scale2.sqrt() {
            let inliers =
                rows.iter().filter(|row| standard(row, &theta).powi(2) <= INLIER_Q * scale2).count();
            return Ok(LinearFit {
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
