//! Holes filled from either side along the row, with a standard deviation that says so.
//!
//! What one camera alone sees lies behind what hides it: a gap between two surfaces belongs to the
//! farther one. Along a slanted surface the gap is bridged. A guess that is wrong is so by far, so
//! the standard deviations are not what most guesses err by, but half of what 95 % of them do on
//! rendered and KITTI pairs: an interval has to hold the truth.

/// Slope of disparity along a row, px per px, up to which the ends of a gap are one surface.
const ONE_SURFACE_SLOPE: f32 = 0.2;
/// Difference of the ends of a gap that is one surface whatever its width, in pixels.
const ONE_SURFACE_STEP: f32 = 1.0;
/// Standard deviation of a bridge, in pixels.
const BRIDGE_SIGMA: f32 = 2.0;
/// Standard deviation of the farther end, in pixels.
const FARTHER_SIGMA: f32 = 2.0;
/// Growth of the standard deviation with the difference of the ends: the gap may belong to the nearer
/// one, and the 95 % interval holds both.
const SIGMA_PER_STEP: f32 = 0.6;
/// Standard deviation where a gap has one end only, in pixels, and its growth with the distance from it.
const BEYOND_SIGMA: f32 = 3.0;
const SIGMA_PER_PIXEL: f32 = 0.03;

/// Pixels that tell of the surface at an end of a gap.
const END_PIXELS: usize = 5;

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
    if step <= ONE_SURFACE_STEP.max(ONE_SURFACE_SLOPE * (length + 1) as f32) {
        let ends = a.1.max(b.1);
        (a.0 + t * (b.0 - a.0), ends.hypot(BRIDGE_SIGMA.hypot(SIGMA_PER_STEP * step)))
    } else {
        let farther = if a.0 < b.0 { a } else { b };
        (farther.0, farther.1.hypot(FARTHER_SIGMA.hypot(SIGMA_PER_STEP * step)))
    }
}

/// Value and standard deviation `distance` pixels beyond the last pixel known.
fn beyond(end: (f32, f32), distance: f32) -> (f32, f32) {
    (end.0, end.1.hypot(BEYOND_SIGMA.hypot(SIGMA_PER_PIXEL * distance)))
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
