//! The better of two displacements at each pixel.

use super::sampling::interpolate;
use super::window::window_sums;
use super::{Displacement, FlowField, FlowOptions};
use crate::geometry::{Grid, Image};

/// At each pixel the one of `found` and `predicted` with the smaller mean-compensated residual over the
/// window; `found` where nothing is predicted.
pub(super) fn better(
    from: &Image,
    to: &Image,
    mut found: Displacement,
    predicted: &FlowField,
    options: &FlowOptions,
) -> Displacement {
    let (pu, pv) = (predicted.u.grid(), predicted.v.grid());
    let cost_found = residual(from, to, &found.u, &found.v, options);
    let cost_predicted = residual(from, to, pu, pv, options);
    let choices = cost_found.values().iter().zip(cost_predicted.values());
    let predictions = pu.values().iter().zip(pv.values());
    let values = found.u.values_mut().iter_mut().zip(found.v.values_mut());
    for ((value, prediction), (cost, cost_predicted)) in values.zip(predictions).zip(choices) {
        if !prediction.0.is_nan() && cost_predicted < cost {
            (*value.0, *value.1) = (*prediction.0, *prediction.1);
        }
    }
    found
}

/// Variance of the difference over each window, in squared grey levels; infinite where most of the
/// window has no counterpart.
fn residual(from: &Image, to: &Image, u: &Grid<f32>, v: &Grid<f32>, options: &FlowOptions) -> Grid<f32> {
    let (width, height) = from.size();
    let inside = |x: f32, y: f32| x >= 0.0 && y >= 0.0 && x <= width as f32 - 1.0 && y <= height as f32 - 1.0;
    let mut cost = Grid::filled(width, height, f32::INFINITY);
    window_sums::<3, f32>(
        (width, height),
        &options.window_weights(),
        cost.values_mut(),
        |y, [count, sum, squares]| {
            for x in 0..width {
                let (tx, ty) = (x as f32 + u.at(x, y), y as f32 + v.at(x, y));
                let known = inside(tx, ty);
                let r = if known { interpolate(to, tx, ty) - from.at(x, y) } else { 0.0 };
                (count[x], sum[x], squares[x]) = (if known { 1.0 } else { 0.0 }, r, r * r);
            }
        },
        |_, [count, sum, squares], out| {
            for x in 0..width {
                if count[x] > 0.5 {
                    let mean = sum[x] / count[x];
                    out[x] = squares[x] / count[x] - mean * mean;
                }
            }
        },
    );
    cost
}
