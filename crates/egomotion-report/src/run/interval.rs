//! A value with its 95 % interval.

use egomotion::motion::TimeToImpact;

/// Half the width of a 95 % band, in σ. Two instead of 1.96, as in the verdicts that the command prints.
pub(crate) const BAND_HALF_WIDTH_SIGMA: f64 = 2.0;

/// A value, and from where to where it lies with 95 %; the far end may be infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interval {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

impl Interval {
    /// The band around a value.
    pub(crate) fn around(value: f64, sigma: f64) -> Self {
        Self {
            value,
            low: value - BAND_HALF_WIDTH_SIGMA * sigma,
            high: value + BAND_HALF_WIDTH_SIGMA * sigma,
        }
    }

    /// Seconds to impact; `None` where nothing approaches.
    pub(crate) fn of_impact(impact: &TimeToImpact) -> Option<Self> {
        let (value, (low, high)) = impact.seconds().zip(impact.interval95_s())?;
        (value.is_finite() && low.is_finite() && !high.is_nan()).then_some(Self { value, low, high })
    }
}
