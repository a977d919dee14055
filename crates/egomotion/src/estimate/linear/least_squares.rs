//! Least squares, equation (57).

use super::fit::LinearFit;
use super::row::{NormalEquations, Row};
use crate::estimate::unsolvable::Unsolvable;

/// How much each row counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// All rows alike, as printed in the paper.
    Unit,
    /// By the inverse variance of each row.
    InverseVariance,
}

impl Weighting {
    /// The weight of a row.
    pub fn of<const N: usize>(self, row: &Row<N>) -> f64 {
        match self {
            Self::Unit => 1.0,
            Self::InverseVariance => (row.sigma * row.sigma).recip(),
        }
    }
}

/// The θ that minimises Σ w (b − a · θ)², all rows kept.
///
/// # Errors
/// [`Unsolvable`] with too few rows or without any determined direction.
pub fn least_squares<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
) -> Result<LinearFit<N>, Unsolvable> {
    let weights: Vec<f64> = rows.iter().map(|row| weighting.of(row)).collect();
    let (theta, observability) =
        NormalEquations::of_weighted_rows(rows.iter().zip(weights.iter().copied())).solve()?;
    let square: f64 = rows.iter().zip(&weights).map(|(row, w)| w * row.residual(&theta).powi(2)).sum();
    let freedom = rows.len().saturating_sub(N).max(1) as f64;
    Ok(LinearFit {
        theta,
        weights,
        observability,
        bread: None,
        inliers: rows.len(),
        residual_scale: (square / freedom).sqrt(),
    })
}
