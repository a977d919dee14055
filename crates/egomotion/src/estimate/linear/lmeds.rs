//! Least median of squares, equations (58) and (59).

use documented::DocumentedFields;
use nalgebra::SVector;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::best_subset::{BestSubset, STRIP, best_subset, square};
use super::fit::LinearFit;
use super::least_squares::{Weighting, least_squares};
use super::row::{NormalEquations, Row};
use crate::estimate::certainty::observability::Observability;
use crate::estimate::random_subsets::{random_subsets, subsets_needed};
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::distribution::SIGMA_PER_MEDIAN_DEVIATION;
use crate::geometry::median;

/// Right-hand sides were rounded when more than this share of them is exactly zero: a continuous measurement never is.
const ROUNDED_ZERO_SHARE: f64 = 0.05;
/// Refits end when no unknown moves by more than this share of its standard deviation.
const REFIT_TOLERANCE: f64 = 1e-3;
/// A direction is determined by the kept rows when they have at least this share of the information of all rows whose
/// residuals their own σ explains: less means that the search has chosen rows which do not speak of it.
const LEAST_KEPT_SHARE: f64 = 0.05;
/// The median of the rows' own σ is that of about so many: its error is then some percent.
const SCALE_ROWS: usize = 4096;
/// Least squared residual that makes an outlier: residuals of an exact fit are rounding errors, and a scale of zero
/// must not reject them all.
const LEAST_CUT2: f64 = 1e-24;

/// How least median of squares searches and refits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, DocumentedFields)]
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

/// Robust standard deviation from the median of squared residuals, 1.4826 (1 + 5/(n − p)) √median.
pub fn robust_scale(median_square: f64, rows: usize, unknowns: usize) -> f64 {
    SIGMA_PER_MEDIAN_DEVIATION
        * (1.0 + 5.0 / rows.saturating_sub(unknowns).max(1) as f64)
        * median_square.sqrt()
}

/// Search over random subsets, reject outliers by the robust scale, refit by least squares until the inliers settle.
///
/// # Errors
/// [`Unsolvable`] with too few rows or when no subset determines θ.
pub fn lmeds<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    options: &LmedsOptions,
) -> Result<LinearFit<N>, Unsolvable> {
    if rows.len() < N {
        return Err(Unsolvable::FewRows { rows: rows.len(), needed: N });
    }
    let count = subsets_needed(options.confidence, options.outliers, N as u32);
    let found = best_subset(rows, weighting, random_subsets(rows.len(), count, options.seed))
        .ok_or(Unsolvable::Unobservable)?;
    refit_best_subset(rows, weighting, &found, options)
}

/// Reject rows beyond the cut of the robust scale around a found subset, then refit by least squares.
///
/// With more than one refit the scale is taken anew around each answer: the best of few subsets lies so far from the
/// minimum that its own median is up to a third too large.
///
/// Where many right-hand sides are exactly zero they were rounded, and the median knows only that no motion fits
/// them perfectly. Then no row is an outlier whose residual its own σ explains, least squares of all rows is a second
/// place to start from, and the better of the two answers is that with the lesser sum of squares in units of σ, cut off
/// at the outliers' limit.
///
/// # Errors
/// [`Unsolvable`] when the inliers determine nothing.
pub fn refit_best_subset<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    found: &BestSubset<N>,
    options: &LmedsOptions,
) -> Result<LinearFit<N>, Unsolvable> {
    let rounded = options.reweights > 1 && are_rounded(rows);
    let refitting = Refitting { rows, weighting, options, rounded, least_scale: own_scale(rows, weighting) };
    let first = refitting.settle(&found.theta, found.median_square);
    if !refitting.rounded {
        return first;
    }
    let all = least_squares(rows, weighting)?.theta;
    let second = refitting.settle(&all, refitting.median_square(&all));
    match (first, second) {
        (Ok(first), Ok(second)) => {
            let second_is_better = refitting.cost(&second.theta) < refitting.cost(&first.theta);
            Ok(if second_is_better { second } else { first })
        }
        (first, second) => first.or(second),
    }
}

/// Whether right-hand sides were rounded.
fn are_rounded<const N: usize>(rows: &[Row<N>]) -> bool {
    let zeros = rows.iter().filter(|row| row.b == 0.0).count();
    zeros as f64 > ROUNDED_ZERO_SHARE * rows.len() as f64
}

/// The median of the rows' own σ, in units of their weighted residuals.
fn own_scale<const N: usize>(rows: &[Row<N>], weighting: Weighting) -> f64 {
    let few = rows.iter().step_by(rows.len().div_ceil(SCALE_ROWS).max(1));
    let mut own: Vec<f64> = few.map(|row| weighting.of(row).sqrt() * row.sigma).collect();
    let middle = median(&mut own);
    if middle.is_finite() { middle } else { 0.0 }
}

/// What refits go by.
struct Refitting<'a, const N: usize> {
    rows: &'a [Row<N>],
    weighting: Weighting,
    options: &'a LmedsOptions,
    rounded: bool,
    /// The scale is at least this: where half the rows fit to rounding, those that fit within their σ are no outliers.
    least_scale: f64,
}

impl<const N: usize> Refitting<'_, N> {
    fn median_square(&self, theta: &SVector<f64, N>) -> f64 {
        let mut squares: Vec<f64> =
            self.rows.par_iter().with_min_len(STRIP).map(|row| square(row, self.weighting, theta)).collect();
        median(&mut squares)
    }

    /// Weights of the rows within the cut around θ; none for the others.
    fn kept(&self, theta: &SVector<f64, N>, scale: f64) -> Vec<f64> {
        let limit = (self.options.cut * scale).powi(2).max(LEAST_CUT2);
        let weigh = |row: &Row<N>| {
            let weight = self.weighting.of(row);
            let own = if self.rounded { weight * (self.options.cut * row.sigma).powi(2) } else { 0.0 };
            if weight * row.residual(theta).powi(2) <= limit.max(own) { weight } else { 0.0 }
        };
        self.rows.par_iter().with_min_len(STRIP).map(weigh).collect()
    }

    /// Least squares of what is kept, until that settles.
    fn settle(&self, theta: &SVector<f64, N>, median_square: f64) -> Result<LinearFit<N>, Unsolvable> {
        let scale_of = |median_square| robust_scale(median_square, self.rows.len(), N).max(self.least_scale);
        let mut scale = scale_of(median_square);
        let mut weights = self.kept(theta, scale);
        let mut equations = NormalEquations::in_strips(self.rows, &weights);
        let mut fit = equations.solve()?;
        for _ in 1..self.options.reweights.max(1) {
            scale = scale_of(self.median_square(&fit.0));
            let next = self.kept(&fit.0, scale);
            if next == weights {
                break;
            }
            weights = next;
            equations = NormalEquations::in_strips(self.rows, &weights);
            let last = std::mem::replace(&mut fit, equations.solve()?);
            let moved = (fit.0 - last.0).component_mul(&equations.information.diagonal().map(f64::sqrt));
            if moved.amax() <= REFIT_TOLERANCE * scale {
                break;
            }
        }
        let (theta, observability) = self.judged(fit, &equations, &weights)?;
        let inliers = weights.iter().filter(|&&w| w > 0.0).count();
        Ok(LinearFit { theta, weights, observability, bread: None, inliers, residual_scale: scale })
    }

    /// The same answer, but a direction counts as undetermined where nearly all that determines it are rejected rows whose
    /// own σ explains their residual.
    fn judged(
        &self,
        (theta, observability): (SVector<f64, N>, Observability),
        kept: &NormalEquations<N>,
        weights: &[f64],
    ) -> Result<(SVector<f64, N>, Observability), Unsolvable> {
        let explained = |(row, kept): &(&Row<N>, &f64)| {
            **kept == 0.0 && row.residual(&theta).abs() <= self.options.cut * row.sigma
        };
        let rejected = self.rows.iter().zip(weights).filter(explained);
        let rejected = rejected.map(|(row, _)| (row, self.weighting.of(row)));
        let rejected = NormalEquations::of_weighted_rows(rejected);
        if rejected.rows == 0 {
            return Ok((theta, observability));
        }
        let all = kept.information + rejected.information;
        let observability = observability
            .exceeding(|direction: &SVector<f64, N>| LEAST_KEPT_SHARE * direction.dot(&(all * direction)))?;
        Ok((observability.solve(&kept.information, &kept.moment)?, observability))
    }

    /// Sum of squared residuals in units of σ, none counted beyond the cut.
    fn cost(&self, theta: &SVector<f64, N>) -> f64 {
        let most = self.options.cut.powi(2);
        // The lesser of the two is never NaN.
        self.rows.iter().map(|row| (row.residual(theta) / row.sigma).powi(2).min(most)).sum()
    }
}
