//! Quantiles of the χ² and the normal distribution, each once.
//!
//! `CHI2_k_Pnn` is exceeded by a χ² of k degrees of freedom with probability 1 − 0.nn, `NORMAL_Pnn` likewise by a
//! standard normal number. The values are rounded as results were made with them: more digits would change numbers
//! that nobody could tell apart, and records that are compared bit by bit. Each comment gives more digits.

/// Median of χ²₁, 0.454 936 423: the square of a normal number of variance 1 exceeds it half of the time.
pub(crate) const CHI2_1_P50: f64 = 0.454_94;
/// Median of χ²₁ to three digits, 0.454 936 423: by it the variance of given disparities is corrected.
pub(crate) const CHI2_1_P50_COARSE: f64 = 0.455;
/// Median of χ²₂, 2 ln 2 = 1.386 294 361.
pub(crate) const CHI2_2_P50: f64 = 1.386;
/// Median of χ²₃, 2.365 973 884: q of three equations of noise alone exceeds it half of the time.
pub(crate) const CHI2_3_P50: f64 = 2.366;
/// χ²₂(0.95) = −2 ln 0.05 = 5.991 464 547: the squared radius of an ellipse that holds 95 %.
pub const CHI2_2_P95: f64 = 5.991_464_547_107_979;
/// χ²₃(0.95) = 7.814 727 903.
pub(crate) const CHI2_3_P95: f64 = 7.8;
/// χ²₁(0.99) = 6.634 896 601.
pub(crate) const CHI2_1_P99: f64 = 6.635;
/// χ²₃(0.99) = 11.344 866 730.
pub(crate) const CHI2_3_P99: f64 = 11.345;
/// χ²₆(0.99) = 16.811 893 830.
pub const CHI2_6_P99: f64 = 16.812;
/// χ²₁(0.997 300 204) = 9: the square of three standard deviations.
pub(crate) const CHI2_1_P9973: f64 = 9.0;
/// χ²₂(0.997 300 204) = 11.829 158 082: an ellipse that holds as much as three standard deviations do.
pub(crate) const CHI2_2_P9973: f64 = 11.83;
/// χ²₆(0.999) = 22.457 744 485.
pub(crate) const CHI2_6_P999: f64 = 22.46;

/// 97.5 % quantile of the normal distribution, 1.959 963 984 540 054: half the width of a 95 % interval, in σ.
pub const NORMAL_P975: f64 = 1.959_963_984_540_054;
/// The same to seven digits.
pub const NORMAL_P975_MEDIUM: f64 = 1.959_964;
/// The same to three digits.
pub const NORMAL_P975_COARSE: f64 = 1.96;
/// Standard deviations of a normal distribution for each median of absolute deviations, 1/Φ⁻¹(0.75) = 1.482 602 219.
pub(crate) const SIGMA_PER_MEDIAN_DEVIATION: f64 = 1.4826;

#[cfg(test)]
mod tests {
    use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

    use super::*;

    /// Probability of what lies within three standard deviations.
    const THREE_SIGMA: f64 = 0.997_300_203_936_740;

    /// Each constant is the exact quantile, rounded to as many places as it is printed with, or to the eight that the
    /// inverse of statrs is good for.
    #[test]
    fn they_are_those_of_the_distributions() {
        let chi2 = |freedom, probability| ChiSquared::new(freedom).unwrap().inverse_cdf(probability);
        let normal = |probability| Normal::new(0.0, 1.0).unwrap().inverse_cdf(probability);
        let all = [
            (CHI2_1_P50, chi2(1.0, 0.5), 5),
            (CHI2_1_P50_COARSE, chi2(1.0, 0.5), 3),
            (CHI2_2_P50, chi2(2.0, 0.5), 3),
            (CHI2_3_P50, chi2(3.0, 0.5), 3),
            (CHI2_2_P95, chi2(2.0, 0.95), 8),
            (CHI2_3_P95, chi2(3.0, 0.95), 1),
            (CHI2_1_P99, chi2(1.0, 0.99), 3),
            (CHI2_3_P99, chi2(3.0, 0.99), 3),
            (CHI2_6_P99, chi2(6.0, 0.99), 3),
            (CHI2_1_P9973, chi2(1.0, THREE_SIGMA), 8),
            (CHI2_2_P9973, chi2(2.0, THREE_SIGMA), 2),
            (CHI2_6_P999, chi2(6.0, 0.999), 2),
            (NORMAL_P975, normal(0.975), 8),
            (NORMAL_P975_MEDIUM, normal(0.975), 6),
            (NORMAL_P975_COARSE, normal(0.975), 2),
            (SIGMA_PER_MEDIAN_DEVIATION, 1.0 / normal(0.75), 4),
        ];
        for (value, exact, places) in all {
            let half_a_unit = 0.5 * 10_f64.powi(-places);
            assert!((value - exact).abs() <= half_a_unit, "{value} is not {exact} to {places} places");
        }
    }
}
