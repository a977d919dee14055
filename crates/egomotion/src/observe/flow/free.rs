//! Flow without a prediction: coarse to fine, and back.
//!
//! Each level is searched patch by patch ([`search`]) and made dense; Lucas–Kanade at every pixel follows. What the
//! backward flow does not undo is dropped.

use super::compare::LevelImages;
use super::displacement::{Displacement, interpolate};
use super::options::FINEST_SEARCH_LEVEL;
use super::refine::{STRIP_ROWS, refine};
use super::search::{PATCH, Patches, SearchPair, search};
use super::step_planes::{FlowPlanes, PixelFlow, is_textureless};
use super::{FlowField, FlowOptions, FlowPair};
use crate::geometry::{Grid, Image};
use crate::observe::spline;
use rayon::prelude::*;

/// Iterations of Lucas–Kanade, each from the smoothed answer of the one before; more cost time.
const REFINE_ITERATIONS: usize = 2;
/// Level at which the search of the backward flow ends: it tells right from wrong, and need not be exact.
const BACKWARD_LEVEL: usize = 1;
/// Rows that are made dense at a time; fixed, so that the sums do not depend on the threads.
const DENSIFY_ROWS: usize = 16;
/// Squared grey levels added to the squared differences: the noise of a good match.
const MATCH_NOISE: f32 = 4.0;

/// Flow by search at every patch; `images` are those at full resolution.
pub(super) fn flow(pair: &FlowPair<'_>, images: LevelImages<'_>, options: &FlowOptions) -> FlowField {
    let levels = pair.levels();
    let coarsest = levels.len() - 1;
    let finest = FINEST_SEARCH_LEVEL.min(coarsest);
    let found = coarse_to_fine(&levels, None, finest, |_, _, _| true);
    let wide = (finest > 0).then(|| {
        let (from, to) = levels[finest];
        let to = &spline::coefficients(to);
        refined(LevelImages { from, to }, found.clone(), None, options)
    });
    let found = found.enlarged(finest, images.from.size());
    let mut flow = refined(images, found, wide.as_ref().map(|wide| (wide, finest)), options);
    if options.consistency_px.is_finite() {
        let coarse = BACKWARD_LEVEL.min(coarsest);
        let back: Vec<(&Image, &Image)> = levels.iter().map(|&(a, b)| (b, a)).collect();
        let backward = coarse_to_fine(&back, None, coarse, |_, _, _| true);
        drop_inconsistent(&mut flow, &backward, coarse, options.consistency_px);
    }
    flow.into_field()
}

/// Dense inverse search from the coarsest level down to level `finest`; the displacement is in pixels of
/// that level. `wanted` gets level and upper left pixel of a patch.
pub(super) fn coarse_to_fine(
    levels: &[(&Image, &Image)],
    initial: Option<&FlowField>,
    finest: usize,
    wanted: impl Fn(usize, usize, usize) -> bool + Sync,
) -> Displacement {
    let coarsest = levels.len() - 1;
    let mut flow: Option<Displacement> = None;
    for (level, (a, b)) in levels.iter().enumerate().skip(finest).rev() {
        let prediction = initial.map(|f| (f, level));
        let pair = SearchPair::new(a, b);
        let wanted = |x: usize, y: usize| wanted(level, x, y);
        let patches = search(&pair, flow.as_ref(), prediction, wanted, level == coarsest);
        flow = Some(densify(&pair, &patches));
    }
    flow.unwrap_or_else(|| Displacement::filled((0, 0), 0.0))
}

/// Lucas–Kanade from a displacement that is smoothed before each iteration; where texture is wanting the `wide`
/// answer of a level.
fn refined(
    images: LevelImages<'_>,
    mut flow: Displacement,
    wide: Option<(&FlowPlanes, usize)>,
    options: &FlowOptions,
) -> FlowPlanes {
    let (width, height) = images.from.size();
    for _ in 1..REFINE_ITERATIONS {
        let before = flow.smoothed();
        let start = |y: usize, u: &mut [f32], v: &mut [f32]| before.copy_row(y, u, v);
        let mut moved = Displacement::filled((width, height), 0.0);
        refine(images, options, f32::INFINITY, start, moved.strips(STRIP_ROWS), |y, _, solved, [u, v]| {
            let row = (y % STRIP_ROWS) * width..(y % STRIP_ROWS + 1) * width;
            u[row.clone()].copy_from_slice(&solved.moved_u[..width]);
            v[row].copy_from_slice(&solved.moved_v[..width]);
        });
        flow = moved;
    }
    let before = flow.smoothed();
    let start = |y: usize, u: &mut [f32], v: &mut [f32]| before.copy_row(y, u, v);
    let mut answers = FlowPlanes::filled(width, height, f32::NAN);
    refine(images, options, f32::INFINITY, start, answers.strips(STRIP_ROWS), |y, _, solved, strip| {
        let mut out = strip.row(y % STRIP_ROWS, width);
        solved.copy_flow_to(&mut out);
        for x in (0..width).filter(|&x| is_textureless(solved.uu[x])) {
            let answer = wide.and_then(|(wide, level)| wide.at_full_resolution(level, (x, y)));
            out.set(x, answer.unwrap_or(PixelFlow::MISSING));
        }
    });
    answers
}

/// Sums of a pixel over the patches that cover it.
#[derive(Debug, Clone, Copy, Default)]
struct PixelSums {
    weight: f32,
    weighted_u: f32,
    weighted_v: f32,
}

/// Mean of the displacements of all patches that cover a pixel, weighted by how well each of them
/// explains this pixel (mean-compensated difference) and its whole patch.
fn densify(pair: &SearchPair<'_>, patches: &Patches) -> Displacement {
    let (width, height) = pair.from.size();
    let mut u = Grid::filled(width, height, 0.0_f32);
    let mut v = u.clone();
    let strips = u
        .values_mut()
        .par_chunks_mut(DENSIFY_ROWS * width)
        .zip(v.values_mut().par_chunks_mut(DENSIFY_ROWS * width));
    strips.enumerate().for_each(|(strip, (u, v))| {
        let top = strip * DENSIFY_ROWS;
        let bottom = (top + DENSIFY_ROWS).min(height);
        let mut sums = vec![PixelSums::default(); width * (bottom - top)];
        for row in 0..patches.rows {
            let (_, y) = patches.corner(0, row);
            if y < bottom && y + PATCH > top {
                for column in 0..patches.columns {
                    accumulate(pair, patches, (column, row), (top, bottom), &mut sums);
                }
            }
        }
        for ((u, v), sums) in u.iter_mut().zip(v).zip(sums) {
            (*u, *v) = (sums.weighted_u / sums.weight, sums.weighted_v / sums.weight);
        }
    });
    Displacement { u, v }
}

/// Add one patch to the sums of the rows top … bottom.
fn accumulate(
    pair: &SearchPair<'_>,
    patches: &Patches,
    (column, row): (usize, usize),
    (top, bottom): (usize, usize),
    sums: &mut [PixelSums],
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
            let weight = 1.0 / ((r * r + MATCH_NOISE) * (m.cost + MATCH_NOISE));
            sums.weight += weight;
            sums.weighted_u += weight * m.u;
            sums.weighted_v += weight * m.v;
        }
    }
}

/// Drop what the `backward` flow (in pixels of its level) does not bring back to within `tolerance`
/// pixels of where it began.
fn drop_inconsistent(flow: &mut FlowPlanes, backward: &Displacement, level: usize, tolerance: f32) {
    let scale = (1_usize << level) as f32;
    flow.strips(1).into_par_iter().enumerate().for_each(|(y, mut row)| {
        for x in 0..row.u.len() {
            let (u, v) = (row.u[x], row.v[x]);
            let (tx, ty) = ((x as f32 + u) / scale, (y as f32 + v) / scale);
            let du = u + scale * interpolate(&backward.u, tx, ty);
            let dv = v + scale * interpolate(&backward.v, tx, ty);
            let agrees = du * du + dv * dv <= tolerance * tolerance;
            if !agrees {
                row.set(x, PixelFlow::MISSING);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_brought_back_is_dropped() {
        let mut flow = FlowPlanes::filled(8, 8, 2.0);
        let back = Grid::from_fn(4, 4, |x, _| if x < 2 { -1.0 } else { 1.0 });
        drop_inconsistent(&mut flow, &Displacement { u: back, v: Grid::filled(4, 4, -1.0) }, 1, 0.5);
        assert_eq!(flow.u.at(0, 3), 2.0);
        assert!(flow.u.at(4, 3).is_nan() && flow.uu.at(4, 3).is_nan());
    }
}
