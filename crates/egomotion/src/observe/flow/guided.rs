//! Flow with a prediction: measured where it leads, and searched for where it is contradicted.
//!
//! A Lucas–Kanade step at the level where the search ends corrects the prediction, whose windows there
//! are wide enough for what a prediction is wrong by; where grey levels contradict it still, the free
//! search looks for a better match. One step at full resolution then measures.

use super::compare::{ComparedRow, LevelImages, TILE};
use super::corrections::{CELL, add_corrections, mark_hidden, predicted_row, spread};
use super::free::{self, coarse_to_fine};
use super::options::FINEST_SEARCH_LEVEL;
use super::refine::{STRIP_ROWS, refine};
use super::search::PATCH;
use super::solve::{NOISE_FLOOR, SolvedRow};
use super::step_planes::{FlowPlanes, FlowRows, StepPlanes, StepState, is_measured, is_seen, is_textureless};
use super::{FlowField, FlowOptions, FlowPair, FlowSpace, GUESS_SIGMA_PX};
use crate::geometry::{Grid, upper_median};
use crate::observe::spline;
use crate::simd::vectorised;
use rayon::prelude::*;

/// Standard deviation by which the prediction damps the steps from it, in pixels of the level.
const PREDICTION_SIGMA_PX: f32 = 0.25;
/// A residual of so many times the image's median is no noise, in variances.
const CONTRADICTION: f32 = 6.0;
/// The median that is believed at most, in variances of the least noise: a prediction may be all wrong.
const LARGEST_MEDIAN: f32 = 16.0;
/// Every so many pixels, along rows and down, are sampled for the median.
const MEDIAN_SAMPLING_PX: usize = 3;
/// Contradicted pixels that make a cell worth a search: half of it.
const CONTRADICTED_PIXELS: usize = CELL * CELL / 2;
/// Factor by which the residual of what the free search finds must be lower to be taken: the prediction is the likelier.
const CLEARLY_BETTER: f32 = 0.6;

/// Flow from the prediction; `images` are those at full resolution.
pub(super) fn flow(
    pair: &FlowPair<'_>,
    images: LevelImages<'_>,
    prediction: &FlowField,
    options: &FlowOptions,
    space: &mut FlowSpace,
) -> FlowField {
    let FlowSpace { from_prediction: coarse, from_search: found, from_both: again } = space;
    let levels = pair.levels();
    let level = FINEST_SEARCH_LEVEL.min(levels.len() - 1);
    let (from, to) = levels[level];
    let coarse_images = LevelImages { from, to: &spline::coefficients(to) };
    let predicted = |y: usize, u: &mut [f32], v: &mut [f32]| predicted_row(prediction, level, y, u, v);

    corrected(coarse_images, predicted, predicted, options, coarse);
    let contradicted = contradicted_cells(coarse);
    // A prediction that most of the image contradicts is none.
    if 2 * contradicted.values().iter().filter(|&&is| is).count() > contradicted.values().len() {
        return free::flow(pair, images, options);
    }
    let cells = around(&contradicted);
    let mut moving = Grid::filled(cells.width(), cells.height(), false);
    if cells.values().contains(&true) {
        let wanted = |at: usize, x: usize, y: usize| covers(&cells, at - level, (x, y));
        let free = coarse_to_fine(&levels, Some(prediction), level, wanted);
        let start = |y: usize, u: &mut [f32], v: &mut [f32]| free.copy_row(y, u, v);
        corrected(coarse_images, predicted, start, options, found);
        moving = better_cells(coarse, found, &cells);
        take_better(coarse, found, &cells, &moving);
    }
    spread(coarse, &moving);
    let start = |y: usize, u: &mut [f32], v: &mut [f32]| {
        predicted(y, u, v);
        add_corrections(coarse, 0, y, u, v);
    };
    corrected(coarse_images, predicted, start, options, again);
    mark_hidden(again);
    spread(again, &moving);
    at_full_resolution(images, prediction, again, level, options)
}

/// One step from `start`, and what it makes of the prediction.
fn corrected(
    images: LevelImages<'_>,
    predicted: impl Fn(usize, &mut [f32], &mut [f32]) + Sync,
    start: impl Fn(usize, &mut [f32], &mut [f32]) + Sync,
    options: &FlowOptions,
    out: &mut StepPlanes,
) {
    let (width, height) = images.from.size();
    out.resize(width, height);
    let strips = out.strips(STRIP_ROWS);
    refine(images, options, PREDICTION_SIGMA_PX, start, strips, |y, _, solved, strip| {
        let k = y % STRIP_ROWS;
        let row = k * width..(k + 1) * width;
        solved.copy_flow_to(&mut strip.flow.row(k, width));
        strip.residual[row.clone()].copy_from_slice(&solved.residual[..width]);
        strip.residual_before[row.clone()].copy_from_slice(&solved.residual_before[..width]);
        let (du, dv) = (&mut strip.correction_u[row.clone()], &mut strip.correction_v[row]);
        predicted(y, du, dv);
        for x in 0..width {
            du[x] = solved.moved_u[x] - du[x];
            dv[x] = solved.moved_v[x] - dv[x];
        }
    });
}

/// Cells where grey levels contradict the prediction.
fn contradicted_cells(step: &StepPlanes) -> Grid<bool> {
    let (width, height) = step.size();
    let (columns, rows) = (width.div_ceil(CELL), height.div_ceil(CELL));
    let sampled = |y| step.residual.row(y).iter().step_by(MEDIAN_SAMPLING_PX).copied();
    let mut sample: Vec<f32> =
        (0..height).step_by(MEDIAN_SAMPLING_PX).flat_map(sampled).filter(|&r| is_seen(r)).collect();
    let Some(median) = upper_median(&mut sample, f32::total_cmp) else {
        return Grid::filled(columns, rows, false);
    };
    let largest = CONTRADICTION * LARGEST_MEDIAN * NOISE_FLOOR * NOISE_FLOOR;
    let limit = largest.min(CONTRADICTION * median);
    let contradicts = |x: usize, y: usize| match step.state(x, y) {
        StepState::Unseen => false,
        // Refuted though the window is all in the image.
        StepState::Refuted => true,
        // Without texture only what no noise explains counts.
        StepState::Textureless => step.residual.at(x, y) > largest,
        StepState::Measured => step.residual.at(x, y) > limit,
    };
    let is_contradicted = |i: usize| {
        let (column, row) = (i % columns, i / columns);
        let mut count = 0;
        for y in row * CELL..((row + 1) * CELL).min(height) {
            let here = column * CELL..((column + 1) * CELL).min(width);
            count += here.filter(|&x| contradicts(x, y)).count();
        }
        count >= CONTRADICTED_PIXELS
    };
    let cells: Vec<bool> =
        (0..columns * rows).into_par_iter().with_min_len(64).map(is_contradicted).collect();
    debug_assert_eq!(cells.len(), columns * rows, "one answer for each cell");
    Grid::from_values(columns, rows, cells).unwrap_or_else(|| Grid::filled(columns, rows, false))
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
fn better_cells(coarse: &StepPlanes, found: &StepPlanes, cells: &Grid<bool>) -> Grid<bool> {
    let (width, height) = coarse.size();
    let sums = Grid::from_fn(cells.width(), cells.height(), |column, row| {
        let mut sums = [0.0_f32; 2];
        if cells.at(column, row) {
            let here = column * CELL..((column + 1) * CELL).min(width);
            for y in row * CELL..((row + 1) * CELL).min(height) {
                let rows = coarse.residual_before.row(y)[here.clone()]
                    .iter()
                    .zip(&found.residual_before.row(y)[here.clone()]);
                for (predicted, found) in rows.filter(|&(a, b)| is_seen(*a) && is_seen(*b)) {
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
fn take_better(coarse: &mut StepPlanes, found: &StepPlanes, cells: &Grid<bool>, moving: &Grid<bool>) {
    debug_assert_eq!(coarse.size(), found.size(), "both steps are of one level");
    let width = found.size().0;
    coarse.strips(CELL).into_par_iter().enumerate().for_each(|(row, mut strip)| {
        for i in 0..strip.residual.len() {
            let (x, y) = (i % width, row * CELL + i / width);
            let state = strip.state(i);
            // What the prediction sends out of the image matches nothing in it but by accident.
            if !cells.at(x / CELL, row) || state == StepState::Unseen {
                continue;
            }
            // A refuted step explains nothing: there what it began with counts.
            let rival =
                if state == StepState::Refuted { strip.residual_before[i] } else { strip.residual[i] };
            let is_taken = if is_measured(found.flow.u.at(x, y)) {
                found.residual.at(x, y) < CLEARLY_BETTER * rival
            } else {
                state != StepState::Measured && moving.at(x / CELL, row)
            };
            if is_taken {
                strip.take(i, found, (x, y));
            }
        }
    });
}

/// Flow at full resolution, from the prediction and its correction at a coarse `level`: what one step measures there, and
/// guesses where it measures nothing.
fn at_full_resolution(
    images: LevelImages<'_>,
    prediction: &FlowField,
    coarse: &StepPlanes,
    level: usize,
    options: &FlowOptions,
) -> FlowField {
    let (width, height) = images.from.size();
    let start = |y: usize, u: &mut [f32], v: &mut [f32]| {
        predicted_row(prediction, 0, y, u, v);
        add_corrections(coarse, level, y, u, v);
    };
    let guess = if options.fill { 0.0 } else { f32::NAN };
    let mut flow = FlowPlanes::filled(width, height, f32::NAN);
    let strips = flow.strips(STRIP_ROWS);
    refine(images, options, PREDICTION_SIGMA_PX, start, strips, |y, compared, solved, strip| {
        let FlowField { u, v, cov_uu, cov_uv, cov_vv } = prediction;
        let predicted = PredictedRow {
            u: u.row(y),
            v: v.row(y),
            uu: cov_uu.row(y),
            uv: cov_uv.row(y),
            vv: cov_vv.row(y),
        };
        // What is hidden at the coarse level is so here.
        let residual = coarse.residual.row((y >> level).min(coarse.size().1 - 1));
        let mut out = strip.row(y % STRIP_ROWS, width);
        answers(compared, solved, &predicted, residual, level, guess, &mut out);
        for x in 0..width {
            if is_textureless(solved.uu[x])
                && is_seen(residual[(x >> level).min(residual.len() - 1)])
                && let Some(wider) = coarse.flow.at_full_resolution(level, (x, y))
            {
                out.set(x, wider);
            }
        }
    });
    flow.into_field()
}

/// A row of the prediction.
struct PredictedRow<'a> {
    u: &'a [f32],
    v: &'a [f32],
    uu: &'a [f32],
    uv: &'a [f32],
    vv: &'a [f32],
}

vectorised! {
/// What is measured, and elsewhere the corrected prediction with a covariance that says that it is a guess;
/// NaN instead of guesses if `guess` is NaN and not 0.
answers(
    compared: &ComparedRow,
    solved: &SolvedRow,
    predicted: &PredictedRow<'_>,
    residual: &[f32],
    level: usize,
    guess: f32,
    out: &mut FlowRows<'_>,
) {
    let FlowRows { u, v, uu, uv, vv } = out;
    let width = u.len();
    debug_assert_eq!(solved.width(), width, "the rows are of one image");
    let variance = GUESS_SIGMA_PX * GUESS_SIGMA_PX;
    for first in (0..width).step_by(TILE) {
        let here = first..(first + TILE).min(width);
        let mut seen = [0.0_f32; TILE];
        for (k, seen) in seen.iter_mut().enumerate() {
            *seen = residual[((first + k) >> level).min(residual.len() - 1)];
        }
        let n = here.len();
        let (u, v) = (&mut u[here.clone()][..n], &mut v[here.clone()][..n]);
        let (uu, uv, vv) =
            (&mut uu[here.clone()][..n], &mut uv[here.clone()][..n], &mut vv[here.clone()][..n]);
        let [pu, pv, puu, puv, pvv] =
            [predicted.u, predicted.v, predicted.uu, predicted.uv, predicted.vv].map(|row| &row[here.clone()][..n]);
        let piece = |row: &'_ [f32]| -> [f32; TILE] {
            row.get(first..).and_then(|l| l.first_chunk::<TILE>()).copied().unwrap_or([f32::NAN; TILE])
        };
        let (su, sv, suu, suv, svv) =
            (piece(&solved.u), piece(&solved.v), piece(&solved.uu), piece(&solved.uv), piece(&solved.vv));
        let (mu, mv) = (piece(&solved.moved_u), piece(&solved.moved_v));
        let (au, av) = (piece(&compared.u), piece(&compared.v));
        for i in 0..n {
            let sees = is_seen(seen[i]);
            let measures = sees & is_measured(su[i]);
            // Without texture a damped step does no harm; a refuted one may.
            let moves = sees & is_textureless(suu[i]);
            let none = if pu[i].is_nan() | pv[i].is_nan() { f32::NAN } else { guess };
            let (gu, gv) = (if moves { mu[i] } else { au[i] } + none, if moves { mv[i] } else { av[i] } + none);
            u[i] = if measures { su[i] } else { gu };
            v[i] = if measures { sv[i] } else { gv };
            uu[i] = if measures { suu[i] } else { puu[i] + variance + none };
            uv[i] = if measures { suv[i] } else { puv[i] + none };
            vv[i] = if measures { svv[i] } else { pvv[i] + variance + none };
        }
    }
}
}
