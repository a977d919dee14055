//! Lucas–Kanade at every pixel of a level: sub-pixel accuracy, and the covariance.
//!
//! How far neighbouring differences are from independent is measured on the images themselves. Demosaicing,
//! compression, rectification, the pyramid's filter and the interpolation between pixels all correlate the noise of
//! neighbours. The variance of Σ g r over a window is then not σ² Σ g² but σ² Σ g² × Σₗ ρ_r(l) ρ_g(l) over the lags l,
//! with ρ the autocorrelations of residual and gradient.

use super::FlowOptions;
use super::compare::{ComparedRow, LevelImages, TILE};
use super::solve::{SUMS, SolvedRow, StepSettings, WindowSums, solve};
use crate::geometry::upper_median;
use crate::simd::vectorised;
use rayon::prelude::*;

/// Rows that are made at a time; fixed, so that the answer does not depend on the threads.
pub(super) const STRIP_ROWS: usize = 48;
/// Columns of the windows of a tile, at most.
const COLUMNS: usize = TILE + 32;
/// Sums side by side, so that they vectorise.
const LANES: usize = 8;
/// Every so many columns and rows are sampled for the correlation of neighbours.
const SAMPLING_PX: (usize, usize) = (2, 32);
/// Residuals larger than this many robust standard deviations are mismatches, not noise.
const OUTLIER_SIGMAS: f32 = 2.5;
/// Standard deviation of normal noise in units of its median absolute deviation: 1/Φ⁻¹(3/4).
const SIGMA_PER_MAD: f32 = 1.4826;

/// One Gauss–Newton step of every pixel's window (everything in pixels of the level).
///
/// `start(y, u, v)` writes the displacement of row y at which the images are compared, each pixel at its
/// own; `consume(y, compared, solved, strip)` gets that row, what the step gives, and which of the `strips` of
/// [`STRIP_ROWS`] it belongs to. Both may be called in any order, and `start` more than once. `prior_sigma_px`, if
/// finite, damps `moved` as a prior of the start would.
pub(super) fn refine<S: Send>(
    images: LevelImages<'_>,
    options: &FlowOptions,
    prior_sigma_px: f32,
    start: impl Fn(usize, &mut [f32], &mut [f32]) + Sync,
    strips: Vec<S>,
    consume: impl Fn(usize, &ComparedRow, &SolvedRow, &mut S) + Sync,
) {
    let (width, height) = images.from.size();
    debug_assert_eq!(strips.len(), height.div_ceil(STRIP_ROWS), "the strips are those of the image");
    let weights = &options.window_weights()[..];
    let radius = options.window_radius_px;
    let variance_factor = variance_factor(images, &start);
    let settings = &StepSettings::new(options, variance_factor, prior_sigma_px);
    strips.into_par_iter().enumerate().for_each_init(
        || (vec![ComparedRow::new(width, radius); weights.len()], SolvedRow::new(width)),
        |(ring, solved), (k, mut strip)| {
            let top = k * STRIP_ROWS;
            let mut next = top.saturating_sub(radius);
            for y in top..(top + STRIP_ROWS).min(height) {
                let last = (y + radius).min(height - 1);
                while next <= last {
                    let row = &mut ring[next % weights.len()];
                    start(next, &mut row.u[..width], &mut row.v[..width]);
                    row.compare(images, next, radius);
                    next += 1;
                }
                let above = y.saturating_sub(radius);
                let rows: Vec<(&ComparedRow, f32)> =
                    (above..=last).map(|k| (&ring[k % weights.len()], weights[k + radius - y])).collect();
                solve_row(&rows, weights, &ring[y % weights.len()], settings, solved);
                consume(y, &ring[y % weights.len()], solved, &mut strip);
            }
        },
    );
}

vectorised! {
/// The step of every pixel of `centre`, from the rows of its windows.
solve_row(
    rows: &[(&ComparedRow, f32)],
    weights: &[f32],
    centre: &ComparedRow,
    settings: &StepSettings,
    solved: &mut SolvedRow,
) {
    for first in (0..solved.width()).step_by(TILE) {
        let sums = across(&down(rows, first, weights.len()), weights);
        solve(&sums, (&centre.u[first..first + TILE], &centre.v[first..first + TILE]), settings, solved, first);
    }
}
}

/// Weighted sums over the rows, of the columns of a tile's windows.
#[inline(always)]
fn down(rows: &[(&ComparedRow, f32)], first: usize, window: usize) -> WindowSums<COLUMNS> {
    let mut columns = [[0.0; COLUMNS]; SUMS];
    for at in (0..TILE + window - 1).step_by(LANES) {
        let mut sums: WindowSums<LANES> = [[0.0; LANES]; SUMS];
        let [counts, us, vs, rs, uus, uvs, vvs, urs, vrs, rrs] = &mut sums;
        for (row, weight) in rows {
            let piece = |line: &'_ [f32]| {
                line.get(first + at..).and_then(|l| l.first_chunk::<LANES>()).copied().unwrap_or_default()
            };
            let (n, u, v, r) =
                (piece(&row.known), piece(&row.slope_u), piece(&row.slope_v), piece(&row.difference));
            for i in 0..LANES {
                let (wu, wv, wr) = (weight * u[i], weight * v[i], weight * r[i]);
                counts[i] += weight * n[i];
                us[i] += wu;
                vs[i] += wv;
                rs[i] += wr;
                uus[i] += wu * u[i];
                uvs[i] += wu * v[i];
                vvs[i] += wv * v[i];
                urs[i] += wu * r[i];
                vrs[i] += wv * r[i];
                rrs[i] += wr * r[i];
            }
        }
        for (column, sum) in columns.iter_mut().zip(sums) {
            column[at..at + LANES].copy_from_slice(&sum);
        }
    }
    columns
}

/// Weighted sums over the columns from each on.
#[inline(always)]
fn across(columns: &WindowSums<COLUMNS>, weights: &[f32]) -> WindowSums<TILE> {
    let mut sums = [[0.0; TILE]; SUMS];
    for (sum, column) in sums.iter_mut().zip(columns) {
        for (k, weight) in weights.iter().enumerate() {
            let Some(line) = column.get(k..).and_then(|line| line.first_chunk::<TILE>()) else { continue };
            for i in 0..TILE {
                sum[i] += weight * line[i];
            }
        }
    }
    sums
}

/// Residual and gradient at a pixel and at its neighbours.
struct Sample {
    /// At the pixel, to the right, below.
    residuals: [f32; 3],
    /// g·g, g·g to the right, g·g below.
    gradients: [f32; 3],
}

/// The factor Σₗ ρ_r(l) ρ_g(l), at least 1, of the separable autocorrelations' first lags.
///
/// `start(y, u, v)` writes the displacement of row y.
fn variance_factor(images: LevelImages<'_>, start: &(impl Fn(usize, &mut [f32], &mut [f32]) + Sync)) -> f32 {
    let (width, height) = images.from.size();
    let rows = (SAMPLING_PX.1 / 2..height.saturating_sub(1)).into_par_iter().step_by(SAMPLING_PX.1);
    let samples = |y: usize| {
        let [here, below] = [y, y + 1].map(|y| {
            let mut row = ComparedRow::new(width, 0);
            start(y, &mut row.u[..width], &mut row.v[..width]);
            row.compare(images, y, 0);
            row
        });
        let columns = (0..width.saturating_sub(1)).step_by(SAMPLING_PX.0);
        columns.filter_map(|x| sample(&here, &below, x)).collect::<Vec<_>>()
    };
    let mut samples: Vec<Sample> = rows.flat_map_iter(samples).collect();
    let Some(offset) = median(samples.iter().map(|s| s.residuals[0])) else { return 1.0 };
    let spread = median(samples.iter().map(|s| (s.residuals[0] - offset).abs())).unwrap_or(0.0);
    let largest = OUTLIER_SIGMAS * SIGMA_PER_MAD * spread;
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
fn sample(here: &ComparedRow, below: &ComparedRow, x: usize) -> Option<Sample> {
    let places = [(here, x), (here, x + 1), (below, x)];
    let product =
        |(row, k): (&ComparedRow, usize)| here.slope_u[x] * row.slope_u[k] + here.slope_v[x] * row.slope_v[k];
    places.iter().all(|(row, k)| row.known[*k] > 0.0).then(|| Sample {
        residuals: places.map(|(row, k)| row.difference[k]),
        gradients: places.map(product),
    })
}

fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    upper_median(&mut values.collect::<Vec<_>>(), f32::total_cmp)
}
