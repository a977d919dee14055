//! How far neighbouring differences are from independent, measured on the images themselves.
//!
//! Demosaicing, compression, rectification, the pyramid's filter and the interpolation between pixels all
//! correlate the noise of neighbours. The variance of Σ g r over a window is then not σ² Σ g² but
//! σ² Σ g² × Σₗ ρ_r(l) ρ_g(l) over the lags l, with ρ the autocorrelations of residual and gradient.

use super::Displacement;
use crate::geometry::Image;
use crate::observe::pyramid::Gradients;
use crate::observe::spline;
use rayon::prelude::*;

/// Every so many rows and columns are sampled.
const STEP: (usize, usize) = (2, 4);
/// Residuals larger than this many robust standard deviations are mismatches, not noise.
const OUTLIER: f32 = 2.5;

/// Residual and gradient at a pixel and at its neighbours to the right and below.
struct Sample {
    residuals: [f32; 3],
    /// g·g, g·g to the right, g·g below.
    gradients: [f32; 3],
}

/// The factor Σₗ ρ_r(l) ρ_g(l), at least 1, of the separable autocorrelations' first lags.
pub(super) fn variance_factor(from: &Image, to: &Image, slopes: &Gradients, flow: &Displacement) -> f32 {
    let (width, height) = from.size();
    let rows = (0..height.saturating_sub(1)).into_par_iter().step_by(STEP.1);
    let mut samples: Vec<Sample> = rows
        .flat_map_iter(|y| {
            let columns = (0..width.saturating_sub(1)).step_by(STEP.0);
            columns.filter_map(move |x| sample(from, to, slopes, flow, x, y))
        })
        .collect();
    let Some(offset) = median(samples.iter().map(|s| s.residuals[0])) else { return 1.0 };
    let spread = median(samples.iter().map(|s| (s.residuals[0] - offset).abs())).unwrap_or(0.0);
    let largest = OUTLIER * 1.4826 * spread;
    samples.retain(|s| s.residuals.iter().all(|r| (r - offset).abs() <= largest));

    let [mut r, mut g] = [[0.0_f64; 3]; 2];
    for sample in &samples {
        for k in 0..3 {
            r[k] += f64::from((sample.residuals[0] - offset) * (sample.residuals[k] - offset));
            g[k] += f64::from(sample.gradients[k]);
        }
    }
    let lag = |k: usize| 1.0 + 2.0 * (r[k] / r[0]).clamp(0.0, 1.0) * (g[k] / g[0]).clamp(0.0, 1.0);
    let factor = (lag(1) * lag(2)) as f32;
    if factor.is_finite() { factor } else { 1.0 }
}

/// The sample at (x, y); `None` where the displacement leaves the second image.
fn sample(
    from: &Image,
    to: &Image,
    slopes: &Gradients,
    flow: &Displacement,
    x: usize,
    y: usize,
) -> Option<Sample> {
    let residual = |x: usize, y: usize| {
        Some(spline::sample(to, x as f32 + flow.u.at(x, y), y as f32 + flow.v.at(x, y))? - from.at(x, y))
    };
    let product = |a: usize, b: usize| {
        slopes.du.at(x, y) * slopes.du.at(a, b) + slopes.dv.at(x, y) * slopes.dv.at(a, b)
    };
    Some(Sample {
        residuals: [residual(x, y)?, residual(x + 1, y)?, residual(x, y + 1)?],
        gradients: [product(x, y), product(x + 1, y), product(x, y + 1)],
    })
}

/// Upper median; `None` of nothing.
fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    let middle = values.len() / 2;
    (middle < values.len()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}
