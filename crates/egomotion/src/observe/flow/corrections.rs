//! Corrections of the prediction at a coarse level: hidden ones dropped, spread over what is not measured, and added to
//! the prediction of a finer level.

use super::FlowField;
use super::compare::TILE;
use super::step_planes::{StepPlanes, StepRows, StepState, UNSEEN};
use crate::geometry::{Grid, upper_median};
use crate::simd::vectorised;
use rayon::prelude::*;

/// Side of the cells in which contradictions are gathered, in pixels of the search's finest level.
pub(super) const CELL: usize = 8;
/// Of two pixels that go to one place, so far apart at most, in pixels of the level, none hides the other: they are
/// neighbours on one surface.
const NEIGHBOURS_PX: usize = 2;
/// Factor by which the residual of the one must be lower for the other to count as hidden.
const CLEARLY_LOWER: f32 = 0.5;
/// Corrections of neighbours that differ by less than this, in pixels of their level, are interpolated.
const SAME_MOTION_PX: f32 = 0.5;

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

/// Mark what is hidden as unseen: one place of the second image shows one place of the first, so of two that go to it
/// the worse is hidden.
pub(super) fn mark_hidden(step: &mut StepPlanes) {
    let (width, height) = step.size();
    let mut claims = Grid::filled(width, height, (f32::INFINITY, 0_u32));
    for y in 0..height {
        let flow = step.flow.u.row(y).iter().zip(step.flow.v.row(y));
        for (x, ((&u, &v), &residual)) in flow.zip(step.residual.row(y)).enumerate() {
            if let Some(at) = target((width, height), (x, y), (u, v))
                && residual < claims.at(at.0, at.1).0
            {
                claims.set(at.0, at.1, (residual, (y * width + x) as u32));
            }
        }
    }
    step.strips(1).into_par_iter().enumerate().for_each(|(y, row)| {
        let StepRows { flow, residual, .. } = row;
        for (x, residual) in residual.iter_mut().enumerate() {
            let Some(at) = target((width, height), (x, y), (flow.u[x], flow.v[x])) else { continue };
            let (least, owner) = claims.at(at.0, at.1);
            let (ox, oy) = (owner as usize % width, owner as usize / width);
            if ox.abs_diff(x).max(oy.abs_diff(y)) > NEIGHBOURS_PX && least < CLEARLY_LOWER * *residual {
                *residual = UNSEEN;
            }
        }
    });
}

/// The pixel of the second image that a measured one goes to, if inside.
fn target(size: (usize, usize), (x, y): (usize, usize), (u, v): (f32, f32)) -> Option<(usize, usize)> {
    let (tx, ty) = (x as f32 + u + 0.5, y as f32 + v + 0.5);
    (tx >= 0.0 && ty >= 0.0 && tx < size.0 as f32 && ty < size.1 as f32).then_some((tx as usize, ty as usize))
}

/// What is not measured keeps the prediction, but in `moving` cells it moves as the cell does unless it is
/// hidden or leaves the image.
pub(super) fn spread(step: &mut StepPlanes, moving: &Grid<bool>) {
    let (width, height) = step.size();
    debug_assert_eq!(
        moving.size(),
        (width.div_ceil(CELL), height.div_ceil(CELL)),
        "the cells are those of the planes"
    );
    step.strips(CELL).into_par_iter().enumerate().for_each(|(row, strip)| {
        let typical_of = |column| {
            if moving.at(column, row) {
                typical([strip.correction_u, strip.correction_v], width, column)
            } else {
                [0.0; 2]
            }
        };
        let cells: Vec<[f32; 2]> = (0..moving.width()).map(typical_of).collect();
        for i in 0..strip.residual.len() {
            let [du, dv] = match strip.state(i) {
                StepState::Unseen => [0.0, 0.0],
                StepState::Textureless | StepState::Refuted => cells[i % width / CELL],
                StepState::Measured => continue,
            };
            (strip.correction_u[i], strip.correction_v[i]) = (du, dv);
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

/// Add the corrections of `step`, made at a coarse `level`, to a row of the prediction: bilinear within a motion, else
/// the nearest.
pub(super) fn add_corrections(step: &StepPlanes, level: usize, y: usize, u: &mut [f32], v: &mut [f32]) {
    let scale = 1.0 / (1_usize << level) as f32;
    let bottom = step.size().1 - 1;
    let fy = y as f32 * scale;
    let y0 = (fy as usize).min(bottom);
    let (y1, b) = ((y0 + 1).min(bottom), fy - y0 as f32);
    for (plane, out) in [(&step.correction_u, u), (&step.correction_v, v)] {
        add_between(plane.row(y0), plane.row(y1), b, level, out);
    }
}

vectorised! {
/// Add the values between two rows of a level, at the fraction `b` of the way.
add_between(above: &[f32], below: &[f32], b: f32, level: usize, out: &mut [f32]) {
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
