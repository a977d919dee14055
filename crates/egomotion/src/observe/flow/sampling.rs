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

/// Catmull–Rom weights of the four pixels around a fraction t of 0 … 1.
fn cubic_weights(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

/// Cubic (Catmull–Rom) value at (x, y), bilinear within a pixel of the border; `None` outside.
#[inline]
pub(super) fn cubic(plane: &Grid<f32>, x: f32, y: f32) -> Option<f32> {
    let (width, height) = plane.size();
    if !(x >= 0.0 && y >= 0.0 && x <= width as f32 - 1.0 && y <= height as f32 - 1.0) {
        return None;
    }
    let (x0, y0) = (x as usize, y as usize);
    if x0 < 1 || y0 < 1 || x0 + 3 > width || y0 + 3 > height {
        return Some(interpolate(plane, x, y));
    }
    let (wx, wy) = (cubic_weights(x - x0 as f32), cubic_weights(y - y0 as f32));
    let mut sum = 0.0;
    for (k, w) in wy.into_iter().enumerate() {
        let four = plane.row(y0 + k - 1).get(x0 - 1..)?.first_chunk::<4>()?;
        sum += w * (four[0] * wx[0] + four[1] * wx[1] + four[2] * wx[2] + four[3] * wx[3]);
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubic_is_exact_for_quadratics_inside() {
        let f = |x: f32, y: f32| 0.5 * x * x - x * y + 2.0 * y + 1.0;
        let plane = Grid::from_fn(8, 8, |u, v| f(u as f32, v as f32));
        for (x, y) in [(3.0, 4.0), (2.25, 4.5), (1.0, 5.75)] {
            assert!((cubic(&plane, x, y).unwrap() - f(x, y)).abs() < 1e-4);
        }
        assert_eq!(cubic(&plane, 7.0, 7.0), Some(f(7.0, 7.0)));
        assert_eq!(cubic(&plane, 7.01, 3.0), None);
        assert_eq!(cubic(&plane, f32::NAN, 3.0), None);
    }
}
