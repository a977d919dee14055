//! Robust regression by iteratively reweighted least squares with Student's t.

use nalgebra::{SMatrix, SVector};

use super::fit::LinearFit;
use super::row::{NormalEquations, Row};
use crate::estimate::student_t::StudentT;
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::distribution::{CHI2_1_P99, SIGMA_PER_MEDIAN_DEVIATION};
use crate::geometry::median;

/// Least squared scale of the residuals, in units of the rows' own σ².
const LEAST_ROW_SCALE2: f64 = 1.0;
/// After the last iteration an answer is good that moved by less than this share of its standard deviation.
const LAST_STEP_SIGMAS: f64 = 0.1;
/// Squared residual, in units of the scaled σ, beyond which a row is no inlier.
const INLIER_Q: f64 = CHI2_1_P99;

/// θ by iteratively reweighted least squares of rows in units of their σ, from a robust start.
///
/// The scale of the residuals is found at the start and stays (the MM-estimator of Yohai 1987): one that follows the
/// weights, which follow the scale, may shrink to nothing about rows that happen to fit. It is at least 1, so that no
/// row is an outlier whose own σ explains its residual. With a fixed scale the cost falls with every step.
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
    let scale2 = (SIGMA_PER_MEDIAN_DEVIATION * median(&mut absolute)).powi(2).max(LEAST_ROW_SCALE2);
    let mut weights = vec![0.0; rows.len()];
    for iteration in 0..kernel.iterations {
        for (row, weight) in rows.iter().zip(&mut weights) {
            let q = standard(row, &theta).powi(2) / scale2;
            *weight = kernel.weight(q, 1.0) / (row.sigma * row.sigma);
        }
        let equations = NormalEquations::of_weighted_rows(rows.iter().zip(weights.iter().copied()));
        let (next, observability) = equations.solve()?;
        let moved = (next - theta).component_mul(&equations.information.diagonal().map(f64::sqrt)).amax();
        theta = next;
        // The last step need not be as short: what is left of the way is small beside the answer's own error.
        let last = iteration + 1 == kernel.iterations;
        let tolerance = if last { kernel.tolerance.max(LAST_STEP_SIGMAS) } else { kernel.tolerance };
        if moved <= tolerance * scale2.sqrt() {
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
