//! Reading a plane between its pixels, in f32.

use crate::geometry::Grid;

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
