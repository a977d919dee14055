//! Least median of squares, equations (58) and (59).

use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use super::least_squares::Weighting;
pub use super::median_search::{Search, plain_search, search};
use super::{Fit, NormalEquations, Row, Unsolvable};

/// How least median of squares searches and refits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LmedsOptions {
    /// Probability P that at least one subset is free of outliers.
    pub confidence: f64,
    /// Largest share ε of outliers that is provided for.
    pub outliers: f64,
    /// Residuals beyond this many robust standard deviations are outliers.
    pub cut: f64,
    /// Most refits by least squares to the inliers; 1 is the paper's, more let them settle.
    pub reweights: usize,
    /// Seed of the random subsets.
    pub seed: u64,
}

impl Default for LmedsOptions {
    fn default() -> Self {
        Self { confidence: 0.99, outliers: 0.5, cut: 2.5, reweights: 20, seed: 1 }
    }
}

/// Number of random p-subsets of which, with probability P, one is free of a share ε of outliers, (59).
pub fn trials(confidence: f64, outliers: f64, subset: u32) -> usize {
    let clean = (1.0 - outliers).powi(subset as i32);
    if clean >= 1.0 {
        return 1;
    }
    let exact = (1.0 - confidence).ln() / (1.0 - clean).ln();
    // P = .99, ε = .1, p = 1 is exactly 2; rounding errors must not make it 3.
    (exact * (1.0 - 1e-12)).ceil().max(1.0) as usize
}

/// `count` random subsets of N different indices below `rows`.
pub fn random_subsets<const N: usize>(
    rows: usize,
    count: usize,
    seed: u64,
) -> impl Iterator<Item = [usize; N]> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..if rows < N { 0 } else { count }).map(move |_| {
        let mut subset = [usize::MAX; N];
        let mut filled = 0;
        while filled < N {
            let candidate = rng.random_range(0..rows);
            if !subset[..filled].contains(&candidate) {
                subset[filled] = candidate;
                filled += 1;
            }
        }
        subset
    })
}

/// Robust standard deviation from the median of squared residuals, 1.4826 (1 + 5/(n − p)) √median.
pub fn robust_scale(median_square: f64, rows: usize, unknowns: usize) -> f64 {
    1.4826 * (1.0 + 5.0 / rows.saturating_sub(unknowns).max(1) as f64) * median_square.sqrt()
}

/// Search over random subsets, reject outliers by the robust scale, refit by least squares until the inliers settle.
///
/// # Errors
/// [`Unsolvable`] with too few rows or when no subset determines θ.
pub fn lmeds<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    options: &LmedsOptions,
) -> Result<Fit<N>, Unsolvable> {
    if rows.len() < N {
        return Err(Unsolvable::FewRows { rows: rows.len(), needed: N });
    }
    let count = trials(options.confidence, options.outliers, N as u32);
    let found = search(rows, weighting, random_subsets(rows.len(), count, options.seed))
        .ok_or(Unsolvable::Unobservable)?;
    refit(rows, weighting, &found, options)
}

/// Reject rows beyond the cut of the robust scale around a found subset, then refit by least squares.
///
/// # Errors
/// [`Unsolvable`] when the inliers determine nothing.
pub fn refit<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    found: &Search<N>,
    options: &LmedsOptions,
) -> Result<Fit<N>, Unsolvable> {
    let scale = robust_scale(found.median_square, rows.len(), N);
    let keep = |theta: &SVector<f64, N>| -> Vec<f64> {
        // Residuals of an exact fit are rounding errors; a scale of zero must not reject them all.
        let limit = (options.cut * scale).powi(2).max(1e-24);
        rows.iter()
            .map(|row| {
                let weight = weighting.of(row);
                if weight * row.residual(theta).powi(2) <= limit { weight } else { 0.0 }
            })
            .collect()
    };
    let mut weights = keep(&found.theta);
    let mut fit = NormalEquations::over(rows.iter().zip(weights.iter().copied())).solve()?;
    for _ in 1..options.reweights.max(1) {
        let next = keep(&fit.0);
        if next == weights {
            break;
        }
        weights = next;
        fit = NormalEquations::over(rows.iter().zip(weights.iter().copied())).solve()?;
    }
    let (theta, observability) = fit;
    let inliers = weights.iter().filter(|&&w| w > 0.0).count();
    Ok(Fit { theta, weights, observability, bread: None, inliers, residual_scale: scale })
}
