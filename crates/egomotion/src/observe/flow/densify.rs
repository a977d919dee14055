//! From patches to pixels, and from level to level.

use super::Displacement;
use super::sampling::interpolate;
use super::search::{PATCH, Pair, Patches};
use crate::geometry::Grid;
use rayon::prelude::*;

/// Rows that are made at a time; fixed, so that the sums do not depend on the threads.
const STRIP: usize = 16;
/// Squared grey levels added to the squared differences: the noise of a good match.
const NOISE: f32 = 4.0;

/// Sums of a pixel: weight, weight × u, weight × v.
type Sums = [f32; 3];

/// Mean of the displacements of all patches that cover a pixel, weighted by how well each of them
/// explains this pixel (mean-compensated difference) and its whole patch.
pub(super) fn densify(pair: &Pair<'_>, patches: &Patches) -> Displacement {
    let (width, height) = pair.from.size();
    let mut u = Grid::filled(width, height, 0.0_f32);
    let mut v = u.clone();
    let strips =
        u.values_mut().par_chunks_mut(STRIP * width).zip(v.values_mut().par_chunks_mut(STRIP * width));
    strips.enumerate().for_each(|(strip, (u, v))| {
        let top = strip * STRIP;
        let bottom = (top + STRIP).min(height);
        let mut sums = vec![[0.0_f32; 3]; width * (bottom - top)];
        for row in 0..patches.rows {
            let (_, y) = patches.corner(0, row);
            if y < bottom && y + PATCH > top {
                for column in 0..patches.columns {
                    accumulate(pair, patches, (column, row), (top, bottom), &mut sums);
                }
            }
        }
        for ((u, v), [w, wu, wv]) in u.iter_mut().zip(v).zip(sums) {
            (*u, *v) = (wu / w, wv / w);
        }
    });
    Displacement { u, v }
}

/// Add one patch to the sums of the rows top … bottom.
fn accumulate(
    pair: &Pair<'_>,
    patches: &Patches,
    (column, row): (usize, usize),
    (top, bottom): (usize, usize),
    sums: &mut [Sums],
) {
    let width = pair.from.width();
    let (x, y) = patches.corner(column, row);
    let m = patches.matches[row * patches.columns + column];
    let moved = pair.patch(x as f32 + m.u, y as f32 + m.v);
    let mut mean = 0.0;
    for (k, moved) in moved.iter().enumerate() {
        let grey = &pair.from.row(y + k)[x..x + PATCH];
        mean += moved.iter().zip(grey).map(|(a, b)| a - b).sum::<f32>();
    }
    mean /= (PATCH * PATCH) as f32;
    for (k, moved) in moved.iter().enumerate() {
        let y = y + k;
        if y < top || y >= bottom {
            continue;
        }
        let grey = &pair.from.row(y)[x..x + PATCH];
        let start = (y - top) * width + x;
        for (i, sums) in sums[start..start + PATCH].iter_mut().enumerate() {
            let r = moved[i] - grey[i] - mean;
            let weight = 1.0 / ((r * r + NOISE) * (m.cost + NOISE));
            sums[0] += weight;
            sums[1] += weight * m.u;
            sums[2] += weight * m.v;
        }
    }
}

/// Displacement of a level brought to full resolution, bilinear.
pub(super) fn enlarge(flow: Displacement, level: usize, (width, height): (usize, usize)) -> Displacement {
    if level == 0 {
        return flow;
    }
    let scale = (1_usize << level) as f32;
    let plane = |coarse: &Grid<f32>| {
        let mut full = Grid::filled(width, height, 0.0_f32);
        full.values_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                *value = scale * interpolate(coarse, x as f32 / scale, y as f32 / scale);
            }
        });
        full
    };
    Displacement { u: plane(&flow.u), v: plane(&flow.v) }
}
