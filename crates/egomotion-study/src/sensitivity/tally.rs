//! ERM, EAM and STD gathered over draws, as sums that give the same whatever the number of parts.

use serde::{Deserialize, Serialize};

use egomotion::metrics::SectionSeven;

/// Sum and sum of squares of a value over draws.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Moments {
    sum: f64,
    squares: f64,
}

impl Moments {
    fn of(value: f64) -> Self {
        Self { sum: value, squares: value * value }
    }

    fn add(&mut self, other: &Self) {
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// Standard deviation, n − 1.
    fn deviation(&self, n: usize) -> Option<f64> {
        let n_f = n as f64;
        (n > 1).then(|| ((self.squares - self.sum * self.sum / n_f).max(0.0) / (n_f - 1.0)).sqrt())
    }
}

/// Errors of one quantity over draws.
///
/// Relative errors are in percent of the truth. Where the truth is zero there are none, and everything is in the
/// quantity's own unit (millimetres or degrees).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorTally {
    /// Number of draws.
    pub n: usize,
    relative: bool,
    signed: Moments,
    absolute: Moments,
    own: Moments,
    spread: Option<Moments>,
}

/// The statistics of the paper's section 7, of one quantity over draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorStatistics {
    /// Mean of (estimate − truth)/truth, in percent; `None` where the truth is zero.
    pub erm_signed: Option<f64>,
    /// Mean of |estimate − truth|/|truth|, in percent; `None` where the truth is zero.
    pub erm_abs: Option<f64>,
    /// Mean of |estimate − truth|, in millimetres or degrees.
    pub eam: f64,
    /// Standard deviation of estimate/truth in percent, of the estimate where the truth is zero: over the points
    /// of a draw for VZ, over the draws for φ.
    pub std: Option<f64>,
    /// Standard error over the draws, of `erm_abs`; of `eam` where the truth is zero.
    pub standard_error: Option<f64>,
    /// Number of draws.
    pub n: usize,
}

impl ErrorStatistics {
    /// Mean of |error|: in percent of the truth, or in millimetres or degrees where the truth is zero.
    pub fn mean_error(&self) -> f64 {
        self.erm_abs.unwrap_or(self.eam)
    }
}

impl ErrorTally {
    /// One draw of a component of φ: `scale` turns its unit into millimetres or degrees.
    pub fn component(estimate: f64, truth: f64, scale: f64) -> Self {
        let error = estimate - truth;
        let relative = truth != 0.0;
        let signed = if relative { 100.0 * error / truth } else { scale * error };
        Self {
            n: 1,
            relative,
            signed: Moments::of(signed),
            absolute: Moments::of(signed.abs()),
            own: Moments::of((scale * error).abs()),
            spread: None,
        }
    }

    /// One draw of VZ: pairs of (estimate, truth) in metres over its points; `None` without a countable point.
    ///
    /// The relative figures count only points whose |truth| reaches `floor_m`.
    pub fn depth_velocity(pairs: &[(f64, f64)], floor_m: f64) -> Option<Self> {
        let figures = SectionSeven::beyond(pairs, floor_m)?;
        Some(Self {
            n: 1,
            relative: true,
            signed: Moments::of(figures.erm_signed_percent?),
            absolute: Moments::of(figures.erm_abs_percent?),
            own: Moments::of(1e3 * figures.eam),
            spread: figures.std_percent.map(Moments::of),
        })
    }

    /// This and other draws of the same quantity.
    pub fn merged(mut self, other: &Self) -> Self {
        self.n += other.n;
        self.relative |= other.relative;
        self.signed.add(&other.signed);
        self.absolute.add(&other.absolute);
        self.own.add(&other.own);
        self.spread = match (self.spread, other.spread) {
            (Some(mut a), Some(b)) => {
                a.add(&b);
                Some(a)
            }
            (a, b) => a.or(b),
        };
        self
    }

    /// The statistics of section 7; `None` without a draw.
    pub fn statistics(&self) -> Option<ErrorStatistics> {
        let n = self.n as f64;
        (self.n > 0).then(|| ErrorStatistics {
            erm_signed: self.relative.then_some(self.signed.sum / n),
            erm_abs: self.relative.then_some(self.absolute.sum / n),
            eam: self.own.sum / n,
            std: self.spread.map_or_else(|| self.signed.deviation(self.n), |spread| Some(spread.sum / n)),
            standard_error: self.absolute.deviation(self.n).map(|deviation| deviation / n.sqrt()),
            n: self.n,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_a_component() {
        // Errors +2, −1, +1 mm of a truth of 10 mm.
        let draws = [0.012, 0.009, 0.011].map(|t| ErrorTally::component(t, 0.010, 1e3));
        let figures = draws[0].merged(&draws[1]).merged(&draws[2]).statistics().unwrap();
        assert!((figures.erm_signed.unwrap() - 20.0 / 3.0).abs() < 1e-9);
        assert!((figures.erm_abs.unwrap() - 40.0 / 3.0).abs() < 1e-9);
        assert!((figures.eam - 4.0 / 3.0).abs() < 1e-9 && figures.n == 3);
        // Deviations of 20, −10, 10 and of 20, 10, 10.
        assert!((figures.std.unwrap() - (700.0f64 / 3.0).sqrt()).abs() < 1e-9);
        assert!((figures.standard_error.unwrap() - (100.0f64 / 3.0 / 3.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_truth_of_zero_has_no_relative_error() {
        let figures = ErrorTally::component(2e-3, 0.0, 1e3)
            .merged(&ErrorTally::component(-4e-3, 0.0, 1e3))
            .statistics()
            .unwrap();
        assert_eq!((figures.erm_signed, figures.erm_abs), (None, None));
        assert!((figures.eam - 3.0).abs() < 1e-12 && (figures.standard_error.unwrap() - 1.0).abs() < 1e-12);
        assert!((figures.std.unwrap() - 18f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn points_near_zero_count_for_the_mean_error_only() {
        let pairs = [(1.1, 1.0), (0.8, 1.0), (0.5, 0.01)];
        let figures = ErrorTally::depth_velocity(&pairs, 0.1).unwrap().statistics().unwrap();
        assert!((figures.erm_abs.unwrap() - 15.0).abs() < 1e-9);
        assert!((figures.erm_signed.unwrap() + 5.0).abs() < 1e-9);
        assert!((figures.eam - 1e3 * 0.79 / 3.0).abs() < 1e-9);
        assert!((figures.std.unwrap() - 450f64.sqrt()).abs() < 1e-9);
        assert!(ErrorTally::depth_velocity(&[(1.0, 0.0)], 0.1).is_none());
    }
}
