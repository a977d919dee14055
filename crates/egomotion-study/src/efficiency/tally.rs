//! Errors of φ gathered over draws in units of the bound, as sums.
//!
//! Each draw also has the *efficient* estimate z: one Gauss–Newton step from the truth, whose error has exactly
//! the bound as its covariance. What is known of z need not be drawn: E u² = 1 + E(u² − z²) and E u = E(u − z),
//! so only the difference from z scatters (a control variate), and few draws tell how near the bound a method is.

use egomotion::geometry::distribution::NORMAL_P975;
use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use egomotion::estimate::MotionEstimate;
use egomotion::geometry::{Gaussian, Twist};

/// Sums over the draws of one component of φ.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct ComponentSums {
    /// Σ (u − z).
    shift: f64,
    /// Σ (u² − z²) and of its square.
    excess: [f64; 2],
    /// Draws whose 95 % interval holds the truth.
    covered: usize,
    /// Draws within 3 of their own σ.
    within_3: usize,
}

/// Errors of one contender over the draws of one setting.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct EfficiencyTally {
    /// Draws with a complete answer.
    pub draws: usize,
    /// Draws without one.
    pub refused: usize,
    components: [ComponentSums; 6],
    /// Σ (NEES/6 − that of z), of its square, and its draws.
    nees: [f64; 2],
    nees_draws: usize,
}

/// Statistics of the errors of one component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EfficiencyStatistics {
    /// Var(component)/bound.
    pub variance_over_bound: f64,
    /// Standard error of that.
    pub standard_error: f64,
    /// Mean error in units of the bound's σ.
    pub bias_over_sigma: f64,
    /// Mean NEES/6 of all six components.
    pub nees_over_6: f64,
    /// Share of 95 % intervals that hold the truth.
    pub coverage_95: f64,
    /// Share of answers within 3 of their own σ.
    pub within_3_sigma: f64,
}

impl EfficiencyTally {
    /// One draw without an answer.
    pub(super) fn refusal() -> Self {
        Self { refused: 1, ..Self::default() }
    }

    /// One draw: an estimate beside the efficient one, whose covariance is the bound.
    pub(super) fn of(estimate: &MotionEstimate, efficient: &Gaussian<6>, truth: &Twist) -> Self {
        let truth = truth.vector();
        let error = estimate.theta.mean - truth;
        let bound: Vector6<f64> = efficient.cov.diagonal().map(f64::sqrt);
        let (u, z) = (error.component_div(&bound), (efficient.mean - truth).component_div(&bound));
        let component = |i: usize| {
            let excess = u[i] * u[i] - z[i] * z[i];
            let own = error[i].abs() / estimate.theta.cov[(i, i)].sqrt();
            ComponentSums {
                shift: u[i] - z[i],
                excess: [excess, excess * excess],
                covered: usize::from(own <= NORMAL_P975),
                within_3: usize::from(own <= 3.0),
            }
        };
        let own = estimate.theta.mahalanobis2(&truth).filter(|d| d.is_finite());
        let apart = own.zip(efficient.mahalanobis2(&truth)).map(|(own, known)| (own - known) / 6.0);
        Self {
            draws: 1,
            refused: 0,
            components: std::array::from_fn(component),
            nees: apart.map_or([0.0; 2], |apart| [apart, apart * apart]),
            nees_draws: usize::from(apart.is_some()),
        }
    }

    /// These draws and others.
    pub(super) fn merged(mut self, other: &Self) -> Self {
        self.draws += other.draws;
        self.refused += other.refused;
        self.nees_draws += other.nees_draws;
        for (sum, more) in self.nees.iter_mut().zip(other.nees) {
            *sum += more;
        }
        for (sums, more) in self.components.iter_mut().zip(&other.components) {
            sums.shift += more.shift;
            sums.excess = [sums.excess[0] + more.excess[0], sums.excess[1] + more.excess[1]];
            sums.covered += more.covered;
            sums.within_3 += more.within_3;
        }
        self
    }

    /// The statistics of component `i` of φ; `None` without an answer.
    pub fn statistics(&self, i: usize) -> Option<EfficiencyStatistics> {
        let sums = self.components.get(i).filter(|_| self.draws > 0)?;
        let n = self.draws as f64;
        let (bias, excess) = (sums.shift / n, sums.excess[0] / n);
        let scatter = (sums.excess[1] / n - excess * excess).max(0.0);
        Some(EfficiencyStatistics {
            variance_over_bound: 1.0 + excess - bias * bias,
            standard_error: (scatter / n).sqrt(),
            bias_over_sigma: bias,
            nees_over_6: 1.0 + self.nees[0] / self.nees_draws as f64,
            coverage_95: sums.covered as f64 / n,
            within_3_sigma: sums.within_3 as f64 / n,
        })
    }

    /// Standard error of NEES/6.
    pub fn nees_standard_error(&self) -> f64 {
        let n = self.nees_draws as f64;
        ((self.nees[1] / n - (self.nees[0] / n).powi(2)).max(0.0) / n).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egomotion::estimate::Estimate;
    use nalgebra::Matrix6;

    #[test]
    fn figures_are_in_units_of_the_bound() {
        let efficient = |error: f64| Gaussian {
            mean: Vector6::from_element(error),
            cov: Matrix6::from_diagonal_element(4.0),
        };
        let estimate = |error: f64| Estimate {
            theta: Gaussian { mean: Vector6::from_element(error), cov: Matrix6::identity() },
            observed: [true; 6],
            undetermined: egomotion::estimate::UndeterminedDirections::default(),
            rows: 9,
            inliers: 9,
            residual_scale: 1.0,
        };
        // Errors of 1.5 and −0.5 σ where the efficient ones are ±1 σ.
        let truth = Twist::zero();
        let both = EfficiencyTally::of(&estimate(3.0), &efficient(2.0), &truth)
            .merged(&EfficiencyTally::of(&estimate(-1.0), &efficient(-2.0), &truth))
            .merged(&EfficiencyTally::refusal());
        let figures = both.statistics(2).unwrap();
        assert_eq!((both.draws, both.refused), (2, 1));
        assert!((figures.bias_over_sigma - 0.5).abs() < 1e-12);
        assert!((figures.variance_over_bound - 1.0).abs() < 1e-12, "{figures:?}");
        // NEES/6 of 9 and 1, where the efficient ones have 1.
        assert!((figures.nees_over_6 - 5.0).abs() < 1e-12);
        assert_eq!((figures.coverage_95, figures.within_3_sigma), (0.5, 1.0));
        assert!(EfficiencyTally::refusal().statistics(0).is_none() && both.statistics(6).is_none());
    }
}
