//! Rounding of a noisy disparity: what (52) says, and what holds.

use std::f64::consts::PI;

use egomotion::geometry::rounding_variance;

/// Exact variance of d + noise rounded to a multiple of `step`, for Gaussian noise of `sigma`; all in pixels.
///
/// (52) adds step²/12 to σ², which is the mean over all places of d between two levels. At one place
/// the sawtooth error and its square are Fourier series, y − round(y) = −(q/π) Σ (−1)ᵏ/k sin(2πky/q),
/// whose means over the noise have factors exp(−2(πkσ/q)²): (52) holds from about σ = q/2 on. Without
/// noise the rounded value does not vary at all.
pub(super) fn rounded_variance(d: f64, sigma: f64, step: f64) -> f64 {
    let ratio = sigma / step;
    if ratio <= 0.0 {
        return 0.0;
    }
    // At k = 1.5/ratio the factor is exp(−44).
    let terms = (1.5 / ratio).ceil().min(1e6) as usize + 1;
    let (mut mean, mut square, mut product) = (0.0, 0.0, 0.0);
    for k in 1..=terms {
        let n = k as f64;
        let (sine, cosine) = (2.0 * PI * (n * d / step).fract()).sin_cos();
        let factor = (-2.0 * (PI * n * ratio).powi(2)).exp() * if k % 2 == 0 { 1.0 } else { -1.0 };
        mean += factor * sine / n;
        square += factor * cosine / (n * n);
        product += factor * cosine;
    }
    // Error of rounding e = round(y) − y: its mean, its mean square, and its covariance with the noise.
    let mean = step / PI * mean;
    let square = rounding_variance(step) + (step / PI).powi(2) * square;
    let product = 2.0 * sigma * sigma * product;
    (sigma * sigma + 2.0 * product + square - mean * mean).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncertainty::monte_carlo::NoisyFunction;

    #[test]
    fn against_draws() {
        for (d, sigma) in [(10.03, 0.07), (10.125, 0.07), (9.99, 0.2), (12.2, 0.05), (7.125, 0.01)] {
            let drawn = NoisyFunction::new([(d, sigma)], |x: &[f64]| (4.0 * x[0] + 0.5).floor() / 4.0)
                .drawn(100_000, 3);
            let exact = rounded_variance(d, sigma, 0.25);
            assert!(
                (drawn.variance - exact).abs() < 5.0 * drawn.standard_error,
                "{d} {sigma} {exact} {drawn:?}"
            );
        }
    }

    #[test]
    fn tends_to_the_printed_rule_with_noise_and_to_nothing_without() {
        let printed = 0.16 + rounding_variance(0.25);
        assert!((rounded_variance(3.1, 0.4, 0.25) / printed - 1.0).abs() < 1e-9);
        assert_eq!(rounded_variance(3.1, 0.0, 0.25), 0.0);
        assert!(rounded_variance(3.0, 1e-3, 0.25) < 1e-12);
    }
}
