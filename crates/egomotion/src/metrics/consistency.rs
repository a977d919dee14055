//! Whether the stated uncertainty is true: NEES and coverage.

use nalgebra::SVector;

use crate::geometry::Gaussian;

/// Normalised estimation error squared over many estimates: whether covariances tell the truth.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Nees {
    sum: f64,
    degrees: usize,
    /// Estimates that were counted.
    pub count: usize,
    /// Estimates whose covariance was singular or not finite.
    pub refused: usize,
}

impl Nees {
    /// Count one estimate against the truth.
    pub fn add<const N: usize>(&mut self, estimate: &Gaussian<N>, truth: &SVector<f64, N>) {
        match estimate.mahalanobis2(truth).filter(|d| d.is_finite()) {
            Some(distance) => {
                self.sum += distance;
                self.degrees += N;
                self.count += 1;
            }
            None => self.refused += 1,
        }
    }

    /// Mean NEES for each degree of freedom: 1 if the covariances are right; `None` before the first estimate.
    pub fn per_degree(&self) -> Option<f64> {
        (self.degrees > 0).then(|| self.sum / self.degrees as f64)
    }

    /// Standard error of [`Nees::per_degree`] if the covariances are right: √(2/degrees).
    pub fn standard_error(&self) -> Option<f64> {
        (self.degrees > 0).then(|| (2.0 / self.degrees as f64).sqrt())
    }
}

/// How many intervals hold the truth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Intervals that hold the truth.
    pub inside: usize,
    /// Intervals whose upper end lies below the truth.
    pub below: usize,
    /// Intervals whose lower end lies above the truth.
    pub above: usize,
}

impl Coverage {
    /// Count the interval `lo` … `hi` (ends included, may be infinite); one with a NaN does not count.
    pub fn add(&mut self, lo: f64, hi: f64, truth: f64) {
        if truth < lo {
            self.above += 1;
        } else if truth > hi {
            self.below += 1;
        } else if lo <= truth && truth <= hi {
            self.inside += 1;
        }
    }

    /// Number of intervals counted.
    pub fn total(&self) -> usize {
        self.inside + self.below + self.above
    }

    /// Share of intervals that hold the truth, 0 … 1; `None` before the first.
    pub fn share(&self) -> Option<f64> {
        (self.total() > 0).then(|| self.inside as f64 / self.total() as f64)
    }
}
