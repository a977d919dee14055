//! Lucas–Kanade at every pixel of a level: sub-pixel accuracy, and the covariance.

use super::FlowOptions;
use super::compare::{Differences, Images, TILE};
use super::solve::{Settings, Solved, solve};
use super::variance_factor::variance_factor;
use crate::observe::planes::Planes;
use crate::simd::vectorised;
use rayon::prelude::*;

/// Rows that are made at a time; fixed, so that the answer does not depend on the threads.
const STRIP: usize = 48;
/// What is summed over the window: count, g, r, g gᵀ, g r, r².
pub(super) const SUMS: usize = 10;
/// Columns of the windows of a tile, at most.
const COLUMNS: usize = TILE + 32;
/// Sums side by side.
const LANES: usize = 8;

/// One Gauss–Newton step of every pixel's window (everything in pixels of the level).
///
/// `start(y, u, v)` writes the displacement of row y at which the images are compared, each pixel at its
/// own; `consume(y, at, solved, out)` gets that row and what the step gives. Both may be called in any order, and `start`
/// more than once. `prior_sigma_px`, if finite, damps `moved` as a prior of the start would.
pub(super) fn refine<const N: usize>(
    images: Images<'_>,
    options: &FlowOptions,
    prior_sigma_px: f32,
    start: impl Fn(usize, &mut [f32], &mut [f32]) + Sync,
    out: &mut Planes<N>,
    consume: impl Fn(usize, &Differences, &Solved, [&mut [f32]; N]) + Sync,
) {
    let (width, height) = images.from.size();
    let weights = &options.window_weights()[..];
    let radius = options.window_radius_px;
    let factor = variance_factor(images, &start);
    let settings = &Settings::new(options, factor, prior_sigma_px);
    out.strips(STRIP).into_par_iter().enumerate().for_each_init(
        || (vec![Differences::new(width, radius); weights.len()], Solved::new(width)),
        |(ring, solved), (strip, mut out)| {
            let top = strip * STRIP;
            let mut next = top.saturating_sub(radius);
            for y in top..(top + STRIP).min(height) {
                let last = (y + radius).min(height - 1);
                while next <= last {
                    let row = &mut ring[next % weights.len()];
                    start(next, &mut row.u[..width], &mut row.v[..width]);
                    row.compare(images, next, radius);
                    next += 1;
                }
                let above = y.saturating_sub(radius);
                let rows: Vec<(&Differences, f32)> =
                    (above..=last).map(|k| (&ring[k % weights.len()], weights[k + radius - y])).collect();
                solve_row(&rows, weights, &ring[y % weights.len()], settings, solved);
                let first = (y - top) * width;
                consume(
                    y,
                    &ring[y % weights.len()],
                    solved,
                    out.each_mut().map(|plane| &mut plane[first..first + width]),
                );
            }
        },
    );
}

vectorised! {
/// The step of every pixel of `centre`, from the rows of its windows.
solve_row(
    rows: &[(&Differences, f32)],
    weights: &[f32],
    centre: &Differences,
    settings: &Settings,
    solved: &mut Solved,
) {
    for first in (0..solved.width()).step_by(TILE) {
        let sums = across(&down(rows, first, weights.len()), weights);
        solve(&sums, (&centre.u[first..first + TILE], &centre.v[first..first + TILE]), settings, solved, first);
    }
}
}

/// Weighted sums over the rows, of the columns of a tile's windows.
#[inline(always)]
fn down(rows: &[(&Differences, f32)], first: usize, window: usize) -> [[f32; COLUMNS]; SUMS] {
    let mut columns = [[0.0; COLUMNS]; SUMS];
    for at in (0..TILE + window - 1).step_by(LANES) {
        let mut sums = [[0.0_f32; LANES]; SUMS];
        for (row, weight) in rows {
            let piece = |line: &'_ [f32]| {
                line.get(first + at..).and_then(|l| l.first_chunk::<LANES>()).copied().unwrap_or_default()
            };
            let (n, a, b, c) =
                (piece(&row.known), piece(&row.slope_u), piece(&row.slope_v), piece(&row.difference));
            for i in 0..LANES {
                let (wa, wb, wc) = (weight * a[i], weight * b[i], weight * c[i]);
                sums[0][i] += weight * n[i];
                sums[1][i] += wa;
                sums[2][i] += wb;
                sums[3][i] += wc;
                sums[4][i] += wa * a[i];
                sums[5][i] += wa * b[i];
                sums[6][i] += wb * b[i];
                sums[7][i] += wa * c[i];
                sums[8][i] += wb * c[i];
                sums[9][i] += wc * c[i];
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
fn across(columns: &[[f32; COLUMNS]; SUMS], weights: &[f32]) -> [[f32; TILE]; SUMS] {
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
