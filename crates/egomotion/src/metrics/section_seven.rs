//! The relative and absolute errors of the paper's section 7.

use super::{mean, mean_abs, quantile, standard_deviation};

/// The figures of the paper's section 7 over pairs of estimate and truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionSeven {
    /// ERM, signed: mean of (estimate − truth)/truth, in percent (Tables 3, 6); `None` where the truth is zero.
    pub erm_signed_percent: Option<f64>,
    /// ERM, absolute: mean of |(estimate − truth)/truth|, in percent; `None` where the truth is zero.
    pub erm_abs_percent: Option<f64>,
    /// Median of |(estimate − truth)/truth|, in percent, which single wild points cannot ruin; `None` where the truth is zero.
    pub erm_median_percent: Option<f64>,
    /// STD: standard deviation of estimate/truth (n − 1), in percent; `None` with fewer than two points.
    pub std_percent: Option<f64>,
    /// EAM: mean of |estimate − truth|, in the unit of the values, over all points.
    pub eam: f64,
    /// Median of |estimate − truth|, in the unit of the values, over all points.
    pub eam_median: f64,
    /// Standard deviation of estimate − truth (n − 1), in the unit of the values; 0 for one point.
    pub std: f64,
    /// Number of points with an estimate and a truth.
    pub count: usize,
    /// Number of them that count for the relative figures.
    pub relative_count: usize,
}

impl SectionSeven {
    /// The figures of (estimate, truth) pairs; `None` without a pair of numbers.
    ///
    /// The relative figures count only points whose |truth| is at least 10 % of its 99th
    /// percentile, since a relative error means nothing where the truth passes through zero.
    pub fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let truths: Vec<f64> =
            pairs.iter().filter(|(e, t)| e.is_finite() && t.is_finite()).map(|(_, t)| t.abs()).collect();
        Self::beyond(pairs, 0.1 * quantile(&truths, 0.99)?)
    }

    /// The same with a floor of its own: relative figures count only points whose |truth| reaches it.
    pub fn beyond(pairs: &[(f64, f64)], floor: f64) -> Option<Self> {
        let known: Vec<_> = pairs.iter().copied().filter(|(e, t)| e.is_finite() && t.is_finite()).collect();
        let countable = known.iter().filter(|(_, t)| *t != 0.0 && t.abs() >= floor);
        let relative: Vec<f64> = countable.map(|(e, t)| 100.0 * (e - t) / t).collect();
        let errors: Vec<f64> = known.iter().map(|(e, t)| e - t).collect();
        Some(Self {
            erm_signed_percent: mean(&relative),
            erm_abs_percent: mean_abs(&relative),
            erm_median_percent: median_abs(&relative),
            std_percent: standard_deviation(&relative),
            eam: mean_abs(&errors)?,
            eam_median: median_abs(&errors)?,
            std: standard_deviation(&errors).unwrap_or(0.0),
            count: errors.len(),
            relative_count: relative.len(),
        })
    }
}

/// Median of absolute values; `None` of no values.
fn median_abs(values: &[f64]) -> Option<f64> {
    quantile(&values.iter().map(|value| value.abs()).collect::<Vec<_>>(), 0.5)
}
