//! Least median of squares, equations (58) and (59).

use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use super::least_squares::Weighting;
use super::{Fit, NormalEquations, Row, Unsolvable, median};

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

/// The best subset found by the search: its θ and the median of its squared residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search<const N: usize> {
    /// θ that fits the subset exactly.
    pub theta: SVector<f64, N>,
    /// Median over all rows of the squared residual.
    pub median_square: f64,
}

/// Minimise the median of squared residuals over the given subsets of N row indices, (58).
pub fn search<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    subsets: impl Iterator<Item = [usize; N]>,
) -> Option<Search<N>> {
    let mut best: Option<Search<N>> = None;
    let mut squares = vec![0.0; rows.len()];
    for subset in subsets {
        let matrix = nalgebra::SMatrix::<f64, N, N>::from_fn(|i, j| rows[subset[i]].a[j]);
        let Some(inverse) = matrix.try_inverse() else { continue };
        let theta = inverse * SVector::<f64, N>::from_fn(|i, _| rows[subset[i]].b);
        if !theta.iter().all(|v| v.is_finite()) {
            continue;
        }
        let limit = best.map_or(f64::INFINITY, |b| b.median_square);
        if !squares_within(rows, weighting, &theta, limit, &mut squares) {
            continue;
        }
        let median_square = median(&mut squares);
        if best.is_none_or(|b| median_square < b.median_square) {
            best = Some(Search { theta, median_square });
        }
    }
    best
}

/// Rows whose squares are counted at once.
const COUNTED: usize = 512;

/// Squared residuals of all rows; false, with the rest left out, once more than half of them reach `limit`.
///
/// Then the median reaches it too, so the subset cannot be the best: the answer is that of the plain search.
fn squares_within<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    theta: &SVector<f64, N>,
    limit: f64,
    squares: &mut [f64],
) -> bool {
    let (mut beyond, total) = (0, rows.len());
    rows.chunks(COUNTED).zip(squares.chunks_mut(COUNTED)).all(|(rows, squares)| {
        for (square, row) in squares.iter_mut().zip(rows) {
            *square = weighting.of(row) * row.residual(theta).powi(2);
        }
        beyond += squares.iter().filter(|&&square| square >= limit).count();
        2 * beyond <= total
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaving_early_changes_no_answer() {
        let mut rng = Pcg64Mcg::seed_from_u64(58);
        for (n, wild) in [(40, 0.4), (41, 0.6), (900, 0.3), (1201, 0.5)] {
            let rows: Vec<Row<2>> = (0..n)
                .map(|block| {
                    let x = rng.random_range(-1.0..1.0);
                    let off: f64 = if rng.random_bool(wild) { 5.0 } else { 0.01 };
                    Row {
                        a: [1.0, x].into(),
                        b: 0.3 - x + off * rng.random_range(-1.0..1.0),
                        sigma: 1.0,
                        block,
                    }
                })
                .collect();
            let subsets: Vec<[usize; 2]> = random_subsets(n, 200, 7).collect();
            let found = search(&rows, Weighting::Unit, subsets.iter().copied()).unwrap();
            // Each subset alone has nothing to leave early for.
            let alone = subsets.iter().filter_map(|s| search(&rows, Weighting::Unit, [*s].into_iter()));
            let plain = alone.min_by(|a, b| a.median_square.total_cmp(&b.median_square)).unwrap();
            assert_eq!(found, plain, "{n}");
        }
    }
}
