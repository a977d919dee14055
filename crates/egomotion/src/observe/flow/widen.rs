//! Answers of wider windows, where narrow ones see too little texture.
//!
//! A window of the same number of pixels at a coarser level covers more of the image: it sees texture
//! farther away, and its noise is less.

use crate::observe::planes::Planes;

/// Answers (u, v, uu, uv, vv) at full resolution, or `None`, at pixel (x, y) from the `wide` ones of a
/// `level`: bilinear displacement, with the covariance of the nearest pixel, for neighbours share most of
/// their error, so that their mean has no less.
#[inline]
pub(super) fn widened<const N: usize>(
    wide: &Planes<N>,
    level: usize,
    (x, y): (usize, usize),
) -> Option<[f32; 5]> {
    let scale = (1_usize << level) as f32;
    let (right, bottom) = (wide.size().0 - 1, wide.size().1 - 1);
    let (fx, fy) = (x as f32 / scale, y as f32 / scale);
    let near = ((fx.round() as usize).min(right), (fy.round() as usize).min(bottom));
    let (x0, y0) = ((fx as usize).min(right), (fy as usize).min(bottom));
    let (x1, y1) = ((x0 + 1).min(right), (y0 + 1).min(bottom));
    let (a, b) = (fx - x0 as f32, fy - y0 as f32);
    let mean = |n: usize| {
        let line = |y: usize| {
            let left = wide.at(n, x0, y);
            // A neighbour that is not needed may be missing.
            if a > 0.0 { left + a * (wide.at(n, x1, y) - left) } else { left }
        };
        let above = line(y0);
        if b > 0.0 { above + b * (line(y1) - above) } else { above }
    };
    let (u, v) = (mean(0), mean(1));
    if u.is_nan() || v.is_nan() {
        return None;
    }
    let cov = [2, 3, 4].map(|n| scale * scale * wide.at(n, near.0, near.1));
    Some([scale * u, scale * v, cov[0], cov[1], cov[2]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wider_window_answers_between_its_pixels_but_not_beside_its_holes() {
        let mut wide = Planes::<5>::filled(4, 4, 0.01);
        for strip in wide.strips(4) {
            let [u, v, ..] = strip;
            for i in 0..16 {
                (u[i], v[i]) = if i % 4 == 3 { (f32::NAN, f32::NAN) } else { ((i % 4) as f32, -1.0) };
            }
        }
        let [u, v, uu, ..] = widened(&wide, 1, (1, 2)).unwrap();
        assert!((u, v) == (1.0, -2.0) && (uu - 0.04).abs() < 1e-6);
        assert_eq!(widened(&wide, 1, (4, 2)).map(|a| a[0]), Some(4.0));
        assert!([5, 6, 7].iter().all(|&x| widened(&wide, 1, (x, 2)).is_none()));
    }
}
