//! What residuals look like: Student's t of the inliers beside outliers at any distance.
//!
//! The squared Mahalanobis lengths q of residuals in three dimensions are taken as a mixture: with probability
//! 1 − ε Student's t of ν degrees of freedom and scale s; with probability ε an outlier, whose length r has no
//! scale, so that ln r is about uniform up to the longest. Noise that is Gaussian is found to be (ν large), and
//! little is lost; front ends on real images have heavier tails (ν small); outliers, even those that agree with
//! each other, are left without any weight, because their density says nothing about the motion.

use crate::estimate::student_t::{LEAST_SCALE2, StudentT};
use crate::geometry::distribution::CHI2_3_P50;
use crate::geometry::median;

/// Dimension of a residual.
const DIMENSION: f64 = 3.0;
/// The exponents m of the densities (1 + q/ν)^−m that are tried: ν = 2 m − 3 = 3, 7, 17, 97.
///
/// Whole exponents spare an exponential for each observation. The last loses less than a thousandth on
/// Gaussian residuals.
const TRIED_EXPONENTS: [i32; 4] = [3, 5, 10, 50];
/// The density of outliers is that of (c + q)^(−3/2) with this c, in units of the squared scale: they have no scale, and
/// c keeps their density finite at zero, where it would outgrow the inliers'.
const OUTLIER_CORE_Q: f64 = 3.0;
/// The mixture is fitted to at most this many residuals, so that its cost does not grow with their number.
const FITTED_RESIDUALS: usize = 500;
/// Iterations of expectation and maximisation for each exponent, each from the result of the last.
const ITERATIONS_PER_EXPONENT: usize = 8;
/// The share of outliers from which the first iteration starts.
const FIRST_OUTLIER_SHARE: f64 = 0.1;
/// Outliers reach at least this many times the first scale: a shorter range would make those near the inliers likelier.
const LEAST_OUTLIER_REACH: f64 = 10.0;
/// Least and greatest share of outliers: a share of zero would stay zero, and a greater one lets a few residuals that
/// happen to agree pass for all inliers.
const OUTLIER_SHARE_BOUNDS: (f64, f64) = (1e-3, 0.7);
/// ν before an exponent was tried; the first likelihood replaces it.
const FIRST_NU: f64 = 4.0;

/// The weights of residuals in units of their scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mixture {
    /// ν; infinite is the Gaussian.
    nu: f64,
    /// (ν + 3)/2 where outliers have a share.
    exponent: i32,
    /// Odds of a residual of length zero to be an outlier.
    odds: f64,
}

impl Mixture {
    /// Student's t alone.
    pub(crate) fn student(kernel: &StudentT) -> Self {
        Self { nu: kernel.nu, exponent: 0, odds: 0.0 }
    }

    /// Nearly Gaussian, with half the weight at `q` and soon none.
    pub(crate) fn within(q: f64) -> Self {
        let exponent = 50;
        let nu = degrees(exponent);
        Self { nu, exponent, odds: (1.0 + q / nu).powi(-exponent) / scale_free(q) }
    }

    /// Weight of a residual of squared length `q`, and −2 ∂ ln weight/∂q.
    #[inline(always)]
    pub(crate) fn weight(&self, q: f64) -> (f64, f64) {
        if self.nu.is_infinite() {
            return (1.0, 0.0);
        }
        let distance = self.nu + q;
        let student = (self.nu + DIMENSION) / distance;
        if self.odds == 0.0 {
            return (student, 2.0 / distance);
        }
        let inlier = self.inlier(q);
        let falling = f64::from(self.exponent) / distance - 0.5 * DIMENSION / (OUTLIER_CORE_Q + q);
        (student * inlier, 2.0 * (1.0 / distance + falling * (1.0 - inlier)))
    }

    /// −2 ln of the density at a squared length `q`, beside a constant: what the weights make least.
    #[inline(always)]
    pub(crate) fn cost(&self, q: f64) -> f64 {
        if self.nu.is_infinite() {
            return q;
        }
        let x = 1.0 + q / self.nu;
        if self.odds == 0.0 {
            return (self.nu + DIMENSION) * x.ln();
        }
        -2.0 * (x.powi(-self.exponent) + self.odds * scale_free(q)).ln()
    }

    /// Whether outliers have a share: then far residuals have no weight at all.
    pub(crate) fn has_outliers(&self) -> bool {
        self.odds > 0.0
    }

    /// Probability that a residual is no outlier.
    #[inline(always)]
    fn inlier(&self, q: f64) -> f64 {
        let x = 1.0 + q / self.nu;
        1.0 / (1.0 + self.odds * x.powi(self.exponent) * scale_free(q))
    }
}

/// How the misclosures of a frame are distributed: their scale, and the mixture in units of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ResidualModel {
    /// The mixture, in units of the squared scale.
    pub mixture: Mixture,
    /// Squared scale of the misclosures in units of their stated covariance.
    pub scale2: f64,
}

impl ResidualModel {
    /// The model that a kernel asks for, from the squared lengths of the residuals.
    ///
    /// `None` without residuals. Reorders `squares`.
    pub(crate) fn of(kernel: &StudentT, squares: &mut [f64]) -> Option<Self> {
        let student = |scale2| Self { mixture: Mixture::student(kernel), scale2 };
        if kernel.nu.is_infinite() {
            return Some(student(1.0));
        }
        if squares.is_empty() {
            return None;
        }
        let stride = squares.len().div_ceil(FITTED_RESIDUALS);
        let few: Vec<f64> = squares.iter().step_by(stride).copied().collect();
        let scale2 = (median(squares) / CHI2_3_P50).max(LEAST_SCALE2);
        Some(if kernel.fitted { fitted(&few, scale2) } else { student(scale2) })
    }
}

/// The most likely model; `scale2` is a first guess.
fn fitted(squares: &[f64], scale2: f64) -> ResidualModel {
    let reach2 = squares.iter().copied().fold(LEAST_OUTLIER_REACH * LEAST_OUTLIER_REACH * scale2, f64::max);
    let mut fit = MixtureFit { scale2, share: FIRST_OUTLIER_SHARE, reach2, squares };
    let mut best = (f64::NEG_INFINITY, Mixture { nu: FIRST_NU, exponent: 0, odds: 0.0 }, scale2);
    for exponent in TRIED_EXPONENTS {
        for _ in 0..ITERATIONS_PER_EXPONENT {
            fit.improve(exponent);
        }
        let likelihood = fit.log_likelihood(exponent);
        if likelihood < best.0 {
            break;
        }
        best = (likelihood, fit.mixture(exponent), fit.scale2);
    }
    ResidualModel { mixture: best.1, scale2: best.2 }
}

/// Expectation and maximisation over the scale and the share of outliers.
struct MixtureFit<'a> {
    scale2: f64,
    share: f64,
    /// The longest squared length of an outlier.
    reach2: f64,
    squares: &'a [f64],
}

impl MixtureFit<'_> {
    fn mixture(&self, exponent: i32) -> Mixture {
        let odds = self.share / (1.0 - self.share) * self.outlier_peak() / self.peak(exponent);
        Mixture { nu: degrees(exponent), exponent, odds }
    }

    /// Density of the t distribution at zero: Γ(m)/(Γ(m − 3/2) (ν π s²)^{3/2}).
    fn peak(&self, exponent: i32) -> f64 {
        gamma_ratio(exponent) / (degrees(exponent) * std::f64::consts::PI * self.scale2).powf(0.5 * DIMENSION)
    }

    /// Density of outliers at zero: with r in units of √c s, ∫ r² (1 + r²)^(−3/2) dr = asinh r − r/√(1 + r²).
    fn outlier_peak(&self) -> f64 {
        let core2 = OUTLIER_CORE_Q * self.scale2;
        let reach2 = self.reach2 / core2;
        let reach = reach2.sqrt();
        let integral = reach.asinh() - reach / (1.0 + reach2).sqrt();
        1.0 / (4.0 * std::f64::consts::PI * integral * core2.powf(0.5 * DIMENSION))
    }

    fn improve(&mut self, exponent: i32) {
        let mixture = self.mixture(exponent);
        let (mut inliers, mut weights, mut square) = (0.0, 0.0, 0.0);
        for q in self.squares {
            let inlier = mixture.inlier(q / self.scale2);
            let weight = inlier / (1.0 + q / (mixture.nu * self.scale2));
            inliers += inlier;
            weights += weight;
            square += weight * q;
        }
        self.share =
            (1.0 - inliers / self.squares.len() as f64).clamp(OUTLIER_SHARE_BOUNDS.0, OUTLIER_SHARE_BOUNDS.1);
        if weights > 0.0 {
            self.scale2 = (square / (DIMENSION * weights)).max(LEAST_SCALE2);
        }
    }

    fn log_likelihood(&self, exponent: i32) -> f64 {
        let (nu, outlier) = (degrees(exponent), self.share * self.outlier_peak());
        let peak = (1.0 - self.share) * self.peak(exponent);
        let density = |q: &f64| {
            let q = q / self.scale2;
            peak / (1.0 + q / nu).powi(exponent) + outlier * scale_free(q)
        };
        self.squares.iter().map(|q| density(q).ln()).sum()
    }
}

/// (1 + q/c)^(−3/2).
#[inline(always)]
fn scale_free(q: f64) -> f64 {
    let y = 1.0 + q / OUTLIER_CORE_Q;
    1.0 / (y * y.sqrt())
}

fn degrees(exponent: i32) -> f64 {
    2.0 * f64::from(exponent) - DIMENSION
}

/// Γ(m)/Γ(m − 3/2).
fn gamma_ratio(exponent: i32) -> f64 {
    // Γ(2)/Γ(1/2), and Γ(x + 1) = x Γ(x).
    (2..exponent).map(f64::from).fold(std::f64::consts::PI.sqrt().recip(), |ratio, m| ratio * m / (m - 1.5))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    fn normal(rng: &mut Pcg64Mcg) -> f64 {
        rng.sample(StandardNormal)
    }

    /// ∫ 4π r² p(r²) dr up to `reach` by the midpoint rule on r = tan a.
    fn total(reach: f64, density: impl Fn(f64) -> f64) -> f64 {
        let n = 200_000;
        let width = reach.atan() / f64::from(n);
        let at = |k: i32| {
            let r = ((f64::from(k) + 0.5) * width).tan();
            4.0 * std::f64::consts::PI * r * r * density(r * r) * (1.0 + r * r) * width
        };
        (0..n).map(at).sum()
    }

    #[test]
    fn densities_are_those_of_probabilities() {
        let fit = MixtureFit { scale2: 1.7, share: 0.0, reach2: 400.0, squares: &[] };
        for exponent in TRIED_EXPONENTS {
            let (peak, nu) = (fit.peak(exponent), degrees(exponent));
            let total = total(1e6, |q| peak / (1.0 + q / (nu * fit.scale2)).powi(exponent));
            assert!((total - 1.0).abs() < 1e-4, "{exponent}: {total}");
        }
        let total = total(20.0, |q| fit.outlier_peak() * scale_free(q / fit.scale2));
        assert!((total - 1.0).abs() < 1e-4, "{total}");
    }

    #[test]
    fn slopes_are_those_of_the_weights() {
        for mixture in [
            Mixture::student(&StudentT { nu: 4.0, ..StudentT::default() }),
            Mixture { nu: 9.0, exponent: 6, odds: 1e-3 },
            Mixture { nu: 97.0, exponent: 50, odds: 1e-5 },
        ] {
            for q in [0.1, 3.0, 11.0, 22.0, 60.0] {
                let h = 1e-5;
                let numeric = -(mixture.weight(q + h).0.ln() - mixture.weight(q - h).0.ln()) / h;
                let slope = mixture.weight(q).1;
                assert!(
                    (numeric - slope).abs() < 1e-6 * slope.max(1.0),
                    "{mixture:?} {q}: {numeric} {slope}"
                );
            }
        }
        // The weight is the cost's slope.
        for mixture in [
            Mixture::student(&StudentT { nu: 4.0, ..StudentT::default() }),
            Mixture { nu: 97.0, exponent: 50, odds: 1e-5 },
        ] {
            for q in [0.1, 3.0, 22.0, 60.0] {
                let numeric = (mixture.cost(q + 1e-5) - mixture.cost(q - 1e-5)) / 2e-5;
                // Outliers' own density falls too, but tells nothing of the motion.
                let outlier_share = if mixture.has_outliers() { 1.0 - mixture.inlier(q) } else { 0.0 };
                let outlier = outlier_share * DIMENSION / (OUTLIER_CORE_Q + q);
                let weight = mixture.weight(q).0;
                assert!((numeric - outlier - weight).abs() < 1e-6, "{mixture:?} {q}: {numeric} {weight}");
            }
        }
        // However far, there is no overflow into something that is not a number.
        let (weight, slope) = Mixture { nu: 97.0, exponent: 50, odds: 1e-5 }.weight(1e30);
        assert!(weight == 0.0 && slope.is_finite());
    }

    #[test]
    fn the_mixture_is_found() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        for (nu, share) in [(f64::INFINITY, 0.0), (f64::INFINITY, 0.4), (3.0, 0.0), (3.0, 0.2)] {
            let square = |i: usize| {
                if (i as f64) < share * 2000.0 {
                    return (0..3).map(|_| rng.random_range(-100.0..100.0f64).powi(2)).sum();
                }
                let length2: f64 = (0..3).map(|_| normal(&mut rng).powi(2)).sum();
                let chi2: f64 = (0..3).map(|_| normal(&mut rng).powi(2)).sum();
                4.0 * if nu.is_infinite() { length2 } else { length2 * 3.0 / chi2 }
            };
            let mut squares: Vec<f64> = (0..2000).map(square).collect();
            let ResidualModel { mixture: found, scale2 } =
                ResidualModel::of(&StudentT::default(), &mut squares).unwrap();
            // With 500 residuals the scale of a Gaussian is known to √(2/1500) = 3.7 %, that of a t, beside ν, to twice that.
            assert!((scale2 / 4.0 - 1.0).abs() < 0.25, "{nu} {share}: {found:?} {scale2}");
            if nu.is_infinite() {
                assert!(found.nu >= 17.0, "{share}: {found:?}");
            } else {
                assert!((3.0..=7.0).contains(&found.nu), "{share}: {found:?}");
            }
            // Outliers at 50 σ and the like have no weight left.
            assert!(found.weight(2500.0).0 < if share > 0.0 { 1e-3 } else { 1e-2 }, "{found:?}");
        }
    }
}
