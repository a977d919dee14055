//! Flow with a prediction: measured where it leads, and searched for where it is contradicted.
//!
//! A Lucas–Kanade step at the level where the search ends corrects the prediction, whose windows there
//! are wide enough for what a prediction is wrong by; where grey levels contradict it still, the free
//! search looks for a better match. One step at full resolution then measures.

use super::claims::hide_claimed;
use super::compare::Images;
use super::free::coarse_to_fine;
use super::measured::measured;
use super::refine::refine;
use super::search::PATCH;
use super::solve::Solved;
use super::{FlowField, FlowOptions, FlowPair, FlowSpace};
use crate::geometry::{Grid, upper_median};
use crate::observe::planes::Planes;
use crate::observe::spline;
use crate::simd::vectorised;
use rayon::prelude::*;

/// Standard deviation by which the prediction damps the steps from it, in pixels of the level.
pub(super) const PREDICTION_SIGMA_PX: f32 = 0.25;
/// A residual of so many times the image's median is no noise, in variances.
const CONTRADICTION: f32 = 6.0;
/// The median that is believed at most, in variances of the least noise: a prediction may be all wrong.
const LARGEST_MEDIAN: f32 = 16.0;
/// Side of the cells in which contradictions are gathered, in pixels of the search's finest level.
const CELL: usize = 8;
/// Contradicted pixels that make a cell worth a search: most of it.
const FEW_CONTRADICTED: usize = CELL * CELL / 2;
/// What the free search finds is taken only if its residual is lower by this factor: the prediction is
/// the likelier.
const CLEARLY_BETTER: f32 = 0.6;
/// Corrections of neighbours that differ by less than this, in pixels of their level, are interpolated.
const SAME_MOTION_PX: f32 = 0.5;

/// What the step at the coarse level gives: answer (u, v, uu, uv, vv), correction of the prediction (u, v),
/// and residual after and before the step.
pub(super) type Coarse = Planes<9>;
/// Places among the planes of [`Coarse`].
pub(super) const CORRECTION: usize = 5;
pub(super) const RESIDUAL: usize = 7;
const BEFORE: usize = 8;

/// Flow from the prediction; `images` are those at full resolution.
pub(super) fn flow(
    pair: &FlowPair<'_>,
    images: Images<'_>,
    prediction: &FlowField,
    options: &FlowOptions,
    space: &mut FlowSpace,
) -> FlowField {
    let FlowSpace { coarse, found, again } = space;
    let levels = pair.levels();
    let level = options.finest_search_level.min(levels.len() - 1);
    let (from, to) = levels[level];
    let coarse_images = Images { from, to: &spline::coefficients(to) };
    let predicted = |y: usize, u: &mut [f32], v: &mut [f32]| predicted_row(prediction, level, y, u, v);

    corrected(coarse_images, predicted, predicted, options, coarse);
    let contradicted = contradicted_cells(coarse, options.noise_floor);
    // A prediction that most of the image contradicts is none.
    if 2 * contradicted.values().iter().filter(|&&is| is).count() > contradicted.values().len() {
        return super::free::flow(pair, images, options);
    }
    let cells = around(&contradicted);
    let mut moving = Grid::filled(cells.width(), cells.height(), false);
    if cells.values().contains(&true) {
        let wanted = |at: usize, x: usize, y: usize| covers(&cells, at - level, (x, y));
        let free = coarse_to_fine(&levels, Some(prediction), level, wanted, options);
        let start = |y: usize, u: &mut [f32], v: &mut [f32]| {
            u.copy_from_slice(free.u.row(y));
            v.copy_from_slice(free.v.row(y));
        };
        corrected(coarse_images, predicted, start, options, found);
        moving = better_cells(coarse, found, &cells);
        take_better(coarse, found, &cells, &moving);
    }
    spread(coarse, &moving);
    let start = |y: usize, u: &mut [f32], v: &mut [f32]| {
        predicted(y, u, v);
        correct(coarse, 0, y, u, v);
    };
    corrected(coarse_images, predicted, start, options, again);
    hide_claimed(again);
    spread(again, &moving);
    measured(images, prediction, again, level, options)
}

/// The prediction of a row of a level, in its pixels; none where nothing is predicted.
pub(super) fn predicted_row(prediction: &FlowField, level: usize, y: usize, u: &mut [f32], v: &mut [f32]) {
    let step = 1 << level;
    let y = (y * step).min(prediction.u.height() - 1);
    let scale = 1.0 / step as f32;
    for (row, out) in [(prediction.u.row(y), u), (prediction.v.row(y), v)] {
        for (out, value) in out.iter_mut().zip(row.iter().step_by(step)) {
            *out = if value.is_nan() { 0.0 } else { scale * value };
        }
    }
}

/// One step from `start`, and what it makes of the prediction.
fn corrected(
    images: Images<'_>,
    predicted: impl Fn(usize, &mut [f32], &mut [f32]) + Sync,
    start: impl Fn(usize, &mut [f32], &mut [f32]) + Sync,
    options: &FlowOptions,
    out: &mut Coarse,
) {
    let (width, height) = images.from.size();
    out.resize(width, height);
    refine(images, options, PREDICTION_SIGMA_PX, start, out, |y, _, solved, out| {
        let [u, v, uu, uv, vv, du, dv, residual, before] = out;
        let Solved { moved_u, moved_v, .. } = solved;
        for (to, from) in [u, v, uu, uv, vv, residual, before].into_iter().zip([
            &solved.u,
            &solved.v,
            &solved.uu,
            &solved.uv,
            &solved.vv,
            &solved.residual,
            &solved.before,
        ]) {
            to.copy_from_slice(&from[..width]);
        }
        predicted(y, du, dv);
        for x in 0..width {
            du[x] = moved_u[x] - du[x];
            dv[x] = moved_v[x] - dv[x];
        }
    });
}

/// Cells where grey levels contradict the prediction.
fn contradicted_cells(coarse: &Coarse, noise: f32) -> Grid<bool> {
    let (width, height) = coarse.size();
    let (columns, rows) = (width.div_ceil(CELL), height.div_ceil(CELL));
    let mut sample: Vec<f32> = (0..height)
        .step_by(3)
        .flat_map(|y| coarse.row(RESIDUAL, y).iter().step_by(3).copied().filter(|r| r.is_finite()))
        .collect();
    let Some(median) = upper_median(&mut sample, f32::total_cmp) else {
        return Grid::filled(columns, rows, false);
    };
    let largest = CONTRADICTION * LARGEST_MEDIAN * noise * noise;
    let limit = largest.min(CONTRADICTION * median);
    let count = |column: usize, row: usize| {
        let mut count = 0;
        for y in row * CELL..((row + 1) * CELL).min(height) {
            let here = column * CELL..((column + 1) * CELL).min(width);
            let (residual, uu) = (&coarse.row(RESIDUAL, y)[here.clone()], &coarse.row(2, y)[here]);
            // Refuted (NaN) though the window is all in the image, or explained badly.
            // Without texture (infinite) only what no noise explains counts.
            let contradicts = |(r, uu): (&f32, &f32)| {
                r.is_finite() && (uu.is_nan() || *r > if *uu == f32::INFINITY { largest } else { limit })
            };
            count += residual.iter().zip(uu).filter(|&pixel| contradicts(pixel)).count();
        }
        count
    };
    let counts: Vec<bool> = (0..columns * rows)
        .into_par_iter()
        .with_min_len(64)
        .map(|i| count(i % columns, i / columns) >= FEW_CONTRADICTED)
        .collect();
    Grid::from_values(columns, rows, counts).unwrap_or_else(|| Grid::filled(columns, rows, false))
}

/// Whether a patch, so many levels above that of the cells, covers one that is set.
fn covers(cells: &Grid<bool>, above: usize, (x, y): (usize, usize)) -> bool {
    let range =
        |c: usize, n: usize| ((c << above) / CELL).min(n)..((c + PATCH) << above).div_ceil(CELL).min(n);
    range(y, cells.height()).any(|row| cells.row(row)[range(x, cells.width())].contains(&true))
}

/// The cells next to those that are set, and these.
fn around(cells: &Grid<bool>) -> Grid<bool> {
    Grid::from_fn(cells.width(), cells.height(), |column, row| {
        (row.saturating_sub(1)..(row + 2).min(cells.height())).any(|row| {
            cells.row(row)[column.saturating_sub(1)..(column + 2).min(cells.width())].contains(&true)
        })
    })
}

/// Cells which, with those around them, are clearly better explained by what was found.
fn better_cells(coarse: &Coarse, found: &Coarse, cells: &Grid<bool>) -> Grid<bool> {
    let (width, height) = coarse.size();
    let sums = Grid::from_fn(cells.width(), cells.height(), |column, row| {
        let mut sums = [0.0_f32; 2];
        if cells.at(column, row) {
            let here = column * CELL..((column + 1) * CELL).min(width);
            for y in row * CELL..((row + 1) * CELL).min(height) {
                let rows =
                    coarse.row(BEFORE, y)[here.clone()].iter().zip(&found.row(BEFORE, y)[here.clone()]);
                for (predicted, found) in rows.filter(|(a, b)| a.is_finite() && b.is_finite()) {
                    sums = [sums[0] + predicted, sums[1] + found];
                }
            }
        }
        sums
    });
    Grid::from_fn(cells.width(), cells.height(), |column, row| {
        let mut total = [0.0_f32; 2];
        for row in row.saturating_sub(1)..(row + 2).min(cells.height()) {
            for [predicted, found] in
                &sums.row(row)[column.saturating_sub(1)..(column + 2).min(cells.width())]
            {
                total = [total[0] + predicted, total[1] + found];
            }
        }
        cells.at(column, row) && total[1] < CLEARLY_BETTER * total[0]
    })
}

/// Take over what was found where the prediction is refuted or clearly worse; in `moving` cells also where
/// neither is measured.
fn take_better(coarse: &mut Coarse, found: &Coarse, cells: &Grid<bool>, moving: &Grid<bool>) {
    let width = found.size().0;
    coarse.strips(CELL).into_par_iter().enumerate().for_each(|(row, mut planes)| {
        for i in 0..planes[0].len() {
            let (x, y) = (i % width, row * CELL + i / width);
            // What the prediction sends out of the image matches nothing in it but by accident.
            if !cells.at(x / CELL, row) || planes[RESIDUAL][i] == f32::INFINITY {
                continue;
            }
            let (old, new) = (planes[0][i], found.at(0, x, y));
            let is_refuted = old.is_nan() && planes[2][i] != f32::INFINITY;
            // A refuted step explains nothing: there what it began with counts.
            let rival = planes[if is_refuted { BEFORE } else { RESIDUAL }][i];
            let is_taken = if new.is_nan() {
                old.is_nan() && moving.at(x / CELL, row)
            } else {
                found.at(RESIDUAL, x, y) < CLEARLY_BETTER * rival
            };
            if is_taken {
                for (n, plane) in planes.iter_mut().enumerate() {
                    plane[i] = found.at(n, x, y);
                }
            }
        }
    });
}

/// What is not measured keeps the prediction, but in `moving` cells it moves as the cell does unless it is
/// hidden or leaves the image.
fn spread(coarse: &mut Coarse, moving: &Grid<bool>) {
    let width = coarse.size().0;
    coarse.strips(CELL).into_par_iter().enumerate().for_each(|(row, planes)| {
        let [u, _, _, _, _, du, dv, residual, _] = planes;
        let cells: Vec<[f32; 2]> = (0..moving.width())
            .map(|column| if moving.at(column, row) { typical([du, dv], width, column) } else { [0.0; 2] })
            .collect();
        for i in 0..u.len() {
            if residual[i] == f32::INFINITY {
                (du[i], dv[i]) = (0.0, 0.0);
            } else if u[i].is_nan() {
                [du[i], dv[i]] = cells[i % width / CELL];
            }
        }
    });
}

/// Medians of both components in a cell of a strip of rows.
fn typical(components: [&[f32]; 2], width: usize, column: usize) -> [f32; 2] {
    let columns = column * CELL..((column + 1) * CELL).min(width);
    components.map(|values| {
        let mut cell: Vec<f32> =
            values.chunks(width).flat_map(|row| row[columns.clone()].iter().copied()).collect();
        upper_median(&mut cell, f32::total_cmp).unwrap_or(0.0)
    })
}

/// Add the coarse level's corrections to a row of the prediction: bilinear within a motion, else the nearest.
pub(super) fn correct(coarse: &Coarse, level: usize, y: usize, u: &mut [f32], v: &mut [f32]) {
    let scale = 1.0 / (1_usize << level) as f32;
    let bottom = coarse.size().1 - 1;
    let fy = y as f32 * scale;
    let y0 = (fy as usize).min(bottom);
    let (y1, b) = ((y0 + 1).min(bottom), fy - y0 as f32);
    for (n, out) in [(CORRECTION, u), (CORRECTION + 1, v)] {
        add_between(coarse.row(n, y0), coarse.row(n, y1), b, level, out);
    }
}

vectorised! {
/// Add the values between two rows of a level, at the fraction `b` of the way.
add_between(above: &[f32], below: &[f32], b: f32, level: usize, out: &mut [f32]) {
    const TILE: usize = 64;
    let step = 1 << level;
    let right = above.len() - 1;
    for first in (0..=right).step_by(TILE) {
        // The last pixel has itself for its neighbour.
        let here = first..(first + TILE).min(right + 1);
        let next = (first + 1).min(right)..(first + TILE + 1).min(right + 1);
        let mut corners = [[0.0; TILE + 1]; 2];
        for (corners, row) in corners.iter_mut().zip([above, below]) {
            corners[..here.len()].copy_from_slice(&row[here.clone()]);
            corners[here.len()] = row[next.end - 1];
        }
        let [above, below] = &corners;
        let (mut values, mut growths) = ([0.0; TILE], [0.0; TILE]);
        for i in 0..TILE {
            let four = [above[i], above[i + 1], below[i], below[i + 1]];
            let low = four[0].min(four[1]).min(four[2].min(four[3]));
            let high = four[0].max(four[1]).max(four[2].max(four[3]));
            let (left, next) = (four[0] + b * (four[2] - four[0]), four[1] + b * (four[3] - four[1]));
            let is_one = high - low < SAME_MOTION_PX;
            values[i] = step as f32 * if is_one { left } else { four[0] };
            growths[i] = if is_one { next - left } else { 0.0 };
        }
        let out = out.chunks_mut(step).skip(first);
        for (out, (value, growth)) in out.zip(values.iter().zip(&growths)) {
            for (k, out) in out.iter_mut().enumerate() {
                *out += value + k as f32 * growth;
            }
        }
    }
}
}
