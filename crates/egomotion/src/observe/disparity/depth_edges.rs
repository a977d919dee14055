//! Depth edges: the gaps that occlusion leaves are filled, and beside a jump the interval holds both surfaces.
//!
//! What one camera alone sees lies behind what hides it: a gap between two surfaces belongs to the
//! farther one. Along a slanted surface the gap is bridged. A guess that is wrong is so by far, so
//! the standard deviations are not what most guesses err by, but half of what 95 % of them do on
//! rendered and KITTI pairs: an interval has to hold the truth.
//!
//! A window that straddles an edge follows the side with more texture, so that edges lie a pixel or two
//! beside where they belong: on rendered pairs, of known truth, a fifth to a half of the pixels next to a
//! jump are on its wrong side. Nothing at the pixel tells which, so the interval has to hold both.

use rayon::prelude::*;

use super::DisparityMap;
use crate::geometry::Field;
use crate::simd::vectorised;

/// Slope of disparity along a row, in pixels per pixel, up to which the ends of a gap are one surface.
const ONE_SURFACE_SLOPE: f32 = 0.2;
/// Difference of the ends of a gap that is one surface whatever its width, in pixels.
const ONE_SURFACE_STEP_PX: f32 = 1.0;
/// Standard deviation of a bridge, in pixels; see above for its source.
const BRIDGE_SIGMA_PX: f32 = 2.0;
/// Standard deviation of the farther end, in pixels; see above for its source.
const FARTHER_SIGMA_PX: f32 = 2.0;
/// Growth of the standard deviation with the difference of the ends: the gap may belong to the nearer
/// one, and the 95 % interval holds both.
const SIGMA_PER_STEP: f32 = 0.6;
/// Standard deviation where a gap has one end only, in pixels; see above for its source.
const BEYOND_SIGMA_PX: f32 = 3.0;
/// Its growth with the distance from that end, in pixels per pixel.
const BEYOND_SIGMA_PER_PX: f32 = 0.03;
/// Pixels whose median tells of the surface at an end of a gap: the last one may well be part of what hides the gap.
const END_PIXELS: usize = 5;
/// How far edges are misplaced at most, in pixels.
const MISPLACED_PX: usize = 2;
/// Difference of neighbours that a slanted surface explains, in pixels: a constant, and more for each pixel between.
const SLANT_STEP_PX: (f32, f32) = (1.0, 0.5);
/// Standard deviation beside a jump as a share of it: twice that holds the other surface.
const SIGMA_PER_JUMP: f32 = 0.5;

/// Fill the gaps of a row (NaN) that are no wider than `widest`.
///
/// A gap that occlusion explains is not wider than the range of disparity; beyond that nothing is known.
pub(super) fn fill_row(shift: &mut [f32], sigma: &mut [f32], widest: usize) {
    let mut start = 0;
    while let Some(gap) = next_gap(shift, start) {
        // What was filled in before does not count as an end.
        let measured = start..gap.start;
        start = gap.end;
        if gap.len() > widest {
            continue;
        }
        let before = end(shift, sigma, measured.rev());
        let after = end(shift, sigma, gap.end..shift.len());
        for u in gap.clone() {
            let (value, spread) = match (before, after) {
                (Some(a), Some(b)) => {
                    between(a, b, (u + 1 - gap.start) as f32 / (gap.len() + 1) as f32, gap.len())
                }
                (Some(a), None) => beyond(a, (u + 1 - gap.start) as f32),
                (None, Some(b)) => beyond(b, (gap.end - u) as f32),
                (None, None) => continue,
            };
            (shift[u], sigma[u]) = (value, spread);
        }
    }
}

/// The surface at an end of a gap: the median of the pixels from there on, and its standard deviation.
///
/// The last pixel alone may well be part of what hides the gap.
fn end(shift: &[f32], sigma: &[f32], pixels: impl Iterator<Item = usize>) -> Option<(f32, f32)> {
    let mut near = [(0.0, 0.0); END_PIXELS];
    let mut count = 0;
    for (slot, u) in near.iter_mut().zip(pixels.take_while(|&u| !shift[u].is_nan())) {
        *slot = (shift[u], sigma[u]);
        count += 1;
    }
    let near = &mut near[..count];
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    near.get(count / 2).copied()
}

/// The next pixels without a value, from `start` on.
fn next_gap(shift: &[f32], start: usize) -> Option<std::ops::Range<usize>> {
    let first = start + shift.get(start..)?.iter().position(|d| d.is_nan())?;
    let length = shift[first..].iter().position(|d| !d.is_nan()).unwrap_or(shift.len() - first);
    Some(first..first + length)
}

/// Value and standard deviation at the fraction `t` of a gap of `length` pixels between two pixels.
fn between(a: (f32, f32), b: (f32, f32), t: f32, length: usize) -> (f32, f32) {
    let step = (b.0 - a.0).abs();
    if step <= ONE_SURFACE_STEP_PX.max(ONE_SURFACE_SLOPE * (length + 1) as f32) {
        let ends = a.1.max(b.1);
        (a.0 + t * (b.0 - a.0), ends.hypot(BRIDGE_SIGMA_PX.hypot(SIGMA_PER_STEP * step)))
    } else {
        let farther = if a.0 < b.0 { a } else { b };
        (farther.0, farther.1.hypot(FARTHER_SIGMA_PX.hypot(SIGMA_PER_STEP * step)))
    }
}

/// Value and standard deviation `distance` pixels beyond the last pixel known.
fn beyond(end: (f32, f32), distance: f32) -> (f32, f32) {
    (end.0, end.1.hypot(BEYOND_SIGMA_PX.hypot(BEYOND_SIGMA_PER_PX * distance)))
}

/// Widen the standard deviations of the pixels beside jumps of disparity.
pub(super) fn widen_beside_edges(map: &mut DisparityMap) {
    let DisparityMap { shift, sigma } = map;
    let (width, height) = shift.size();
    let shift: &Field = shift;
    let rows = sigma.rows_mut().enumerate();
    rows.for_each_init(
        || vec![0.0; width],
        |jump, (v, sigma)| {
            let here = shift.row(v);
            jump.fill(0.0);
            for reach in 1..=MISPLACED_PX.min(width.saturating_sub(1)) {
                let step = SLANT_STEP_PX.0 + SLANT_STEP_PX.1 * reach as f32;
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
                let other = SIGMA_PER_JUMP * *jump;
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
    use crate::geometry::Grid;

    const NONE: f32 = f32::NAN;

    fn filled(row: &[f32], widest: usize) -> (Vec<f32>, Vec<f32>) {
        let mut shift = row.to_vec();
        let mut sigma: Vec<f32> = row.iter().map(|d| if d.is_nan() { NONE } else { 0.1 }).collect();
        fill_row(&mut shift, &mut sigma, widest);
        (shift, sigma)
    }

    #[test]
    fn a_gap_in_a_surface_is_bridged_and_an_occlusion_is_behind() {
        let (shift, sigma) = filled(&[4.0, NONE, 4.5, 4.5, NONE, NONE, 12.0, NONE], 4);
        assert_eq!(shift, [4.0, 4.25, 4.5, 4.5, 4.5, 4.5, 12.0, 12.0]);
        assert!(sigma[1] >= 1.0 && sigma[4] >= 2.0 && sigma[7] >= 1.0 && sigma[3] == 0.1);
    }

    #[test]
    fn wide_gaps_and_empty_rows_stay_missing() {
        let (shift, _) = filled(&[NONE, NONE, NONE, 5.0, NONE, 5.0], 2);
        assert_eq!(shift[..3].iter().filter(|d| d.is_nan()).count(), 3);
        assert_eq!(shift[3..], [5.0, 5.0, 5.0]);
        assert!(filled(&[NONE; 4], 9).0.iter().all(|d| d.is_nan()));
        assert!(filled(&[], 9).0.is_empty());
    }

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
