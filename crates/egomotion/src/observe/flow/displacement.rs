//! A dense displacement without holes, as one step of the flow hands it to the next: read between its pixels,
//! enlarged, smoothed.

use crate::geometry::Grid;
use rayon::prelude::*;

/// Pixels on either side that take part in smoothing.
const SMOOTHING_RADIUS: usize = 2;
/// Neighbours whose components differ by less than this, in pixels, belong to the same motion: smoothing with a larger
/// one blurs the edges of motion.
const SAME_MOTION_PX: f32 = 0.5;

/// Displacement of every pixel of a level, in pixels of that level.
#[derive(Debug, Clone)]
pub(super) struct Displacement {
    pub u: Grid<f32>,
    pub v: Grid<f32>,
}

impl Displacement {
    /// The same displacement everywhere.
    pub(super) fn filled((width, height): (usize, usize), value: f32) -> Self {
        let plane = Grid::filled(width, height, value);
        Self { u: plane.clone(), v: plane }
    }

    /// Copy row `y` of u and of v.
    pub(super) fn copy_row(&self, y: usize, u: &mut [f32], v: &mut [f32]) {
        u.copy_from_slice(self.u.row(y));
        v.copy_from_slice(self.v.row(y));
    }

    /// Displacement of a level brought to full resolution, bilinear.
    pub(super) fn enlarged(self, level: usize, (width, height): (usize, usize)) -> Self {
        if level == 0 {
            return self;
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
        Self { u: plane(&self.u), v: plane(&self.v) }
    }

    /// Mean over the neighbours that move alike (sigma filter), along rows and then along columns: noise goes, the
    /// edges of motion stay.
    pub(super) fn smoothed(&self) -> Self {
        let along_rows = filter(self, |y, around| {
            let padded = [pad(self.u.row(y)), pad(self.v.row(y))];
            let width = self.u.width();
            for k in 0..=2 * SMOOTHING_RADIUS {
                around(&padded[0][k..k + width], &padded[1][k..k + width]);
            }
        });
        filter(&along_rows, |y, around| {
            for k in 0..=2 * SMOOTHING_RADIUS {
                let row = (y + k).saturating_sub(SMOOTHING_RADIUS).min(self.u.height() - 1);
                around(along_rows.u.row(row), along_rows.v.row(row));
            }
        })
    }
}

/// Bilinear value at (x, y), which is clamped to the plane; the plane is not empty.
#[inline]
pub(super) fn interpolate(plane: &Grid<f32>, x: f32, y: f32) -> f32 {
    let (width, height) = plane.size();
    let (x, y) = (x.clamp(0.0, (width - 1) as f32), y.clamp(0.0, (height - 1) as f32));
    let (x0, y0) = (x as usize, y as usize);
    let (a, b) = (x - x0 as f32, y - y0 as f32);
    let x1 = (x0 + 1).min(width - 1);
    let line = |row: &[f32]| row[x0] + a * (row[x1] - row[x0]);
    let (above, below) = (line(plane.row(y0)), line(plane.row((y0 + 1).min(height - 1))));
    above + b * (below - above)
}

/// A row with its ends repeated.
fn pad(row: &[f32]) -> Vec<f32> {
    let ends = |value: Option<&f32>| [value.copied().unwrap_or(0.0); SMOOTHING_RADIUS];
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
