//! Beside a depth edge a pixel may belong to the other surface.
//!
//! A window that straddles an edge follows the side with more texture, so that edges lie a pixel or two
//! beside where they belong: on rendered pairs, of known truth, a fifth to a half of the pixels next to a
//! jump are on its wrong side. Nothing at the pixel tells which, so the interval has to hold both.

use rayon::prelude::*;

use super::DisparityMap;
use crate::simd::vectorised;

/// How far edges are misplaced, in pixels.
const REACH: usize = 2;
/// Difference of neighbours that a slanted surface explains: a constant, and more for each pixel between, in pixels.
const ONE_SURFACE: (f32, f32) = (1.0, 0.5);
/// Standard deviation as a share of the jump: twice it holds the other surface.
const SHARE: f32 = 0.5;

/// Widen the standard deviations of the pixels beside jumps of disparity.
pub(super) fn widen_beside_edges(map: &mut DisparityMap) {
    let DisparityMap { shift, sigma } = map;
    let (width, height) = shift.size();
    let shift: &crate::geometry::Field = shift;
    let rows = sigma.rows_mut().enumerate();
    rows.for_each_init(
        || vec![0.0; width],
        |jump, (v, sigma)| {
            let here = shift.row(v);
            jump.fill(0.0);
            for reach in 1..=REACH.min(width.saturating_sub(1)) {
                let step = ONE_SURFACE.0 + ONE_SURFACE.1 * reach as f32;
                let (left, right) = (&here[..width - reach], &here[reach..]);
                largest_jump(left, right, step, &mut jump[..width - reach]);
                largest_jump(right, left, step, &mut jump[reach..]);
                if v >= reach {
                    largest_jump(here, shift.row(v - reach), step, jump);
                }
                if v + reach < height {
                    largest_jump(here, shift.row(v + reach), step, jump);
                }
            }
            for (sigma, jump) in sigma.iter_mut().zip(jump) {
                let other = SHARE * *jump;
                *sigma = (*sigma * *sigma + other * other).sqrt();
            }
        },
    );
}

vectorised! {
/// The larger of what is known and the jump from `here` to `there`, where it is more than `step`.
largest_jump(here: &[f32], there: &[f32], step: f32, largest: &mut [f32]) {
    let n = largest.len();
    let (here, there) = (&here[..n], &there[..n]);
    for i in 0..n {
        let jump = (here[i] - there[i]).abs();
        // Of NaN both comparisons are false.
        let jump = if jump > step { jump } else { 0.0 };
        largest[i] = if jump > largest[i] { jump } else { largest[i] };
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Field, Grid};

    #[test]
    fn only_what_lies_beside_a_jump_is_widened() {
        let (width, height) = (17, 9);
        let at = |u: usize, v: usize| match u {
            0..8 => 5.0 + 0.4 * v as f32,
            13 => f32::NAN,
            _ => 15.0 + 0.4 * v as f32,
        };
        let shift = Field::from_grid(Grid::from_fn(width, height, at));
        let sigma =
            Field::from_grid(Grid::from_fn(
                width,
                height,
                |u, v| if at(u, v).is_nan() { f32::NAN } else { 0.1 },
            ));
        let mut map = DisparityMap { shift, sigma };
        widen_beside_edges(&mut map);
        for v in 0..height {
            for u in 0..width {
                let sigma = map.sigma.get(u, v);
                match u {
                    13 => assert_eq!(sigma, None),
                    6..10 => assert!((sigma.unwrap() - 5.0_f32.hypot(0.1)).abs() < 1e-6),
                    _ => assert_eq!(sigma, Some(0.1)),
                }
            }
        }
    }
}
