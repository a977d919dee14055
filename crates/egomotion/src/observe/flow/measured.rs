//! The step at full resolution, and guesses where it measures nothing.

use super::compare::{Differences, Images};
use super::guided::{Coarse, PREDICTION_SIGMA_PX, RESIDUAL, correct, predicted_row};
use super::refine::refine;
use super::solve::Solved;
use super::widen::widened;
use super::{FlowField, FlowOptions, GUESS_SIGMA_PX};
use crate::observe::planes::Planes;
use crate::simd::vectorised;

/// Flow at full resolution, from the prediction and its correction at a coarse `level`.
pub(super) fn measured(
    images: Images<'_>,
    prediction: &FlowField,
    coarse: &Coarse,
    level: usize,
    options: &FlowOptions,
) -> FlowField {
    let (width, height) = images.from.size();
    let start = |y: usize, u: &mut [f32], v: &mut [f32]| {
        predicted_row(prediction, 0, y, u, v);
        correct(coarse, level, y, u, v);
    };
    let mut flow = Planes::<5>::filled(width, height, f32::NAN);
    refine(images, options, PREDICTION_SIGMA_PX, start, &mut flow, |y, at, solved, mut out| {
        let FlowField { u, v, cov_uu, cov_uv, cov_vv } = prediction;
        let predicted = [u.row(y), v.row(y), cov_uu.row(y), cov_uv.row(y), cov_vv.row(y)];
        // What is hidden at the coarse level is so here.
        let hidden = coarse.row(RESIDUAL, (y >> level).min(coarse.size().1 - 1));
        let guess = if options.fill { 0.0 } else { f32::NAN };
        answers(at, solved, predicted, hidden, level, guess, out.each_mut().map(|row| &mut **row));
        for x in 0..width {
            let lacks_texture = solved.uu[x] == f32::INFINITY;
            if lacks_texture
                && hidden[(x >> level).min(hidden.len() - 1)] < f32::INFINITY
                && let Some(wider) = widened(coarse, level, (x, y))
            {
                for (out, value) in out.iter_mut().zip(wider) {
                    out[x] = value;
                }
            }
        }
    });
    FlowField::from_planes(flow)
}

vectorised! {
/// What is measured, and elsewhere the corrected prediction with a covariance that says that it is a guess;
/// NaN instead of guesses if `guess` is NaN and not 0.
answers(
    at: &Differences,
    solved: &Solved,
    predicted: [&[f32]; 5],
    residual: &[f32],
    level: usize,
    guess: f32,
    out: [&mut [f32]; 5],
) {
    const TILE: usize = 64;
    let width = out[0].len();
    let [u, v, uu, uv, vv] = out;
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
        let [pu, pv, puu, puv, pvv] = predicted.map(|row| &row[here.clone()][..n]);
        let piece = |row: &'_ [f32]| -> [f32; TILE] {
            row.get(first..).and_then(|l| l.first_chunk::<TILE>()).copied().unwrap_or([f32::NAN; TILE])
        };
        let (su, sv, suu, suv, svv) =
            (piece(&solved.u), piece(&solved.v), piece(&solved.uu), piece(&solved.uv), piece(&solved.vv));
        let (mu, mv) = (piece(&solved.moved_u), piece(&solved.moved_v));
        let (au, av) = (piece(&at.u), piece(&at.v));
        for i in 0..n {
            let is_seen = seen[i] < f32::INFINITY;
            let is_measured = is_seen & !su[i].is_nan();
            // Without texture a damped step does no harm; a refuted one may.
            let moves = is_seen & (suu[i] == f32::INFINITY);
            let none = if pu[i].is_nan() | pv[i].is_nan() { f32::NAN } else { guess };
            let (gu, gv) = (if moves { mu[i] } else { au[i] } + none, if moves { mv[i] } else { av[i] } + none);
            u[i] = if is_measured { su[i] } else { gu };
            v[i] = if is_measured { sv[i] } else { gv };
            uu[i] = if is_measured { suu[i] } else { puu[i] + variance + none };
            uv[i] = if is_measured { suv[i] } else { puv[i] + none };
            vv[i] = if is_measured { svv[i] } else { pvv[i] + variance + none };
        }
    }
}
}
