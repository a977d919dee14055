//! How far neighbouring differences are from independent, measured on the images themselves.
//!
//! Demosaicing, compression, rectification, the pyramid's filter and the interpolation between pixels all
//! correlate the noise of neighbours. The variance of Σ g r over a window is then not σ² Σ g² but
//! σ² Σ g² × Σₗ ρ_r(l) ρ_g(l) over the lags l, with ρ the autocorrelations of residual and gradient.

use super::compare::{Differences, Images};
use crate::geometry::upper_median;
use rayon::prelude::*;

/// Every so many columns and rows are sampled.
const STEP: (usize, usize) = (2, 32);
/// Residuals larger than this many robust standard deviations are mismatches, not noise.
const OUTLIER: f32 = 2.5;

/// Residual and gradient at a pixel and at its neighbours to the right and below.
struct Sample {
    residuals: [f32; 3],
    /// g·g, g·g to the right, g·g below.
    gradients: [f32; 3],
}

/// The factor Σₗ ρ_r(l) ρ_g(l), at least 1, of the separable autocorrelations' first lags.
///
/// `start(y, u, v)` writes the displacement of row y.
pub(super) fn variance_factor(
    images: Images<'_>,
    start: &(impl Fn(usize, &mut [f32], &mut [f32]) + Sync),
) -> f32 {
    let (width, height) = images.from.size();
    let rows = (STEP.1 / 2..height.saturating_sub(1)).into_par_iter().step_by(STEP.1);
    let samples = |y: usize| {
        let [here, below] = [y, y + 1].map(|y| {
            let mut row = Differences::new(width, 0);
            start(y, &mut row.u[..width], &mut row.v[..width]);
            row.compare(images, y, 0);
            row
        });
        let columns = (0..width.saturating_sub(1)).step_by(STEP.0);
        columns.filter_map(|x| sample(&here, &below, x)).collect::<Vec<_>>()
    };
    let mut samples: Vec<Sample> = rows.flat_map_iter(samples).collect();
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

/// The sample at column `x` of a row and the one below it; `None` where the second image has no counterpart.
fn sample(here: &Differences, below: &Differences, x: usize) -> Option<Sample> {
    let places = [(here, x), (here, x + 1), (below, x)];
    let product =
        |(row, k): (&Differences, usize)| here.slope_u[x] * row.slope_u[k] + here.slope_v[x] * row.slope_v[k];
    places.iter().all(|(row, k)| row.known[*k] > 0.0).then(|| Sample {
        residuals: places.map(|(row, k)| row.difference[k]),
        gradients: places.map(product),
    })
}

fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    upper_median(&mut values.collect::<Vec<_>>(), f32::total_cmp)
}
