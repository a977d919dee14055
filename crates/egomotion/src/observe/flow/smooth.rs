//! Smoothing of a displacement that keeps the edges of motion.

use super::Displacement;
use crate::geometry::Grid;
use rayon::prelude::*;

/// Pixels on either side that take part.
const RADIUS: usize = 2;
/// Neighbours whose components differ by less than this, in pixels, belong to the same motion.
const SAME_MOTION_PX: f32 = 0.5;

/// Mean over the neighbours that move alike (sigma filter), along rows and then along columns.
pub(super) fn smooth(flow: &Displacement) -> Displacement {
    let along_rows = filter(flow, |y, around| {
        let padded = [pad(flow.u.row(y)), pad(flow.v.row(y))];
        let width = flow.u.width();
        for k in 0..=2 * RADIUS {
            around(&padded[0][k..k + width], &padded[1][k..k + width]);
        }
    });
    filter(&along_rows, |y, around| {
        for k in 0..=2 * RADIUS {
            let row = (y + k).saturating_sub(RADIUS).min(flow.u.height() - 1);
            around(along_rows.u.row(row), along_rows.v.row(row));
        }
    })
}

/// A row with its ends repeated.
fn pad(row: &[f32]) -> Vec<f32> {
    let ends = |value: Option<&f32>| [value.copied().unwrap_or(0.0); RADIUS];
    [&ends(row.first())[..], row, &ends(row.last())[..]].concat()
}

/// Mean, for each row y, over the rows that `neighbours` shows of y, itself among them.
fn filter(
    flow: &Displacement,
    neighbours: impl Fn(usize, &mut dyn FnMut(&[f32], &[f32])) + Sync,
) -> Displacement {
    let (width, height) = flow.u.size();
    let mut u = Grid::filled(width, height, 0.0_f32);
    let mut v = u.clone();
    let rows = u.values_mut().par_chunks_mut(width).zip(v.values_mut().par_chunks_mut(width));
    rows.enumerate().for_each_init(
        || vec![0.0_f32; width],
        |count, (y, (u, v))| {
            count.fill(0.0);
            let (own_u, own_v) = (flow.u.row(y), flow.v.row(y));
            neighbours(y, &mut |other_u, other_v| {
                let rows = other_u.iter().zip(other_v).zip(own_u.iter().zip(own_v));
                let sums = count.iter_mut().zip(u.iter_mut().zip(v.iter_mut()));
                for (((other_u, other_v), (own_u, own_v)), (count, (u, v))) in rows.zip(sums) {
                    let du = (other_u - own_u).abs();
                    let dv = (other_v - own_v).abs();
                    let alike = (du < SAME_MOTION_PX) & (dv < SAME_MOTION_PX);
                    let weight = if alike { 1.0 } else { 0.0 };
                    *count += weight;
                    *u += weight * other_u;
                    *v += weight * other_v;
                }
            });
            for x in 0..width {
                u[x] /= count[x];
                v[x] /= count[x];
            }
        },
    );
    Displacement { u, v }
}
