//! The disparity of a corner without any prior: a search along its row at half resolution.

use super::stereo_pyramid::StereoPyramid;
use crate::geometry::Image;
use crate::simd::vectorised;

/// Half the side of the compared windows, in pixels of half resolution.
const RADIUS: usize = 4;
/// Side of the compared windows, in pixels of half resolution.
const SIDE: usize = 2 * RADIUS + 1;
/// Shifts that are compared at a time, so that they vectorise.
const LANES: usize = 16;
/// The best shift's cost must be below this share of that of any other but its neighbours.
const UNIQUENESS: f32 = 0.85;

/// Shift u_left − u_right of the pixel (u, v), 0 to `largest_px`, to two pixels; `None` if not clearly the best.
///
/// The cost is the sum of absolute differences of windows reduced to zero mean.
pub(super) fn search_row(frame: &StereoPyramid, u: usize, v: usize, largest_px: usize) -> Option<f64> {
    let level = usize::from(frame.left.levels().len() > 1);
    let size = 1 << level;
    let (left, right) = (frame.left.levels().get(level)?, frame.right.levels().get(level)?);
    let (u, v) = (u / size, v / size);
    if u < RADIUS || v < RADIUS || u + RADIUS >= left.width() || v + RADIUS >= left.height() {
        return None;
    }
    let most = (largest_px / size).min(u - RADIUS);
    let mut costs = vec![0.0; (most + 1).next_multiple_of(LANES)];
    all_costs(left, right, (u, v), most, &mut costs)?;
    costs.truncate(most + 1);
    // The first cost belongs to the largest shift.
    let best = (0..costs.len()).rev().min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;
    let rival = costs.iter().enumerate().filter(|(k, _)| k.abs_diff(best) > 1).map(|(_, &c)| c);
    let rival = rival.fold(f32::INFINITY, f32::min);
    (costs[best] < UNIQUENESS * rival).then_some(((most - best) * size) as f64)
}

vectorised! {
/// Costs of the shifts from `most` down to 0; what lies beyond has no meaning.
all_costs(left: &Image, right: &Image, at: (usize, usize), most: usize, costs: &mut [f32]) -> Option<()> {
    let (u, v) = at;
    let mut window = [[0.0_f32; SIDE]; SIDE];
    let mut sum = 0.0;
    for (k, window) in window.iter_mut().enumerate() {
        *window = *left.row(v + k - RADIUS)[u - RADIUS..].first_chunk::<SIDE>()?;
        sum += window.iter().sum::<f32>();
    }
    let mean = sum / (SIDE * SIDE) as f32;
    window.as_flattened_mut().iter_mut().for_each(|value| *value -= mean);
    for (chunk, costs) in costs.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        let first = u - most - RADIUS + chunk * LANES;
        // Lanes beyond shift 0 may read into the next row.
        let row = |k: usize| {
            let start = (v + k - RADIUS) * right.width() + first;
            right.values().get(start..)?.first_chunk::<{ LANES + SIDE - 1 }>()
        };
        let mut sums = [0.0_f32; LANES];
        for k in 0..SIDE {
            let row = row(k)?;
            for column in 0..SIDE {
                for i in 0..LANES {
                    sums[i] += row[column + i];
                }
            }
        }
        let means = sums.map(|sum| sum / (SIDE * SIDE) as f32);
        *costs = [0.0; LANES];
        for (k, window) in window.iter().enumerate() {
            let row = row(k)?;
            for (column, &value) in window.iter().enumerate() {
                for i in 0..LANES {
                    costs[i] += (value - (row[column + i] - means[i])).abs();
                }
            }
        }
    }
    Some(())
}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;

    #[test]
    fn shifts_are_found_over_the_whole_range_and_only_where_unique() {
        let grey = |u: usize, v: usize| ((u * u * 7 + v * 131 + (u / 3) * v * 17) % 211) as f32;
        // Texture of four pixels, so that half resolution still shows it.
        let left = Grid::from_fn(300, 80, |u, v| grey(u / 4, v / 4));
        for shift in [0_usize, 12, 60, 124] {
            let right = Grid::from_fn(300, 80, |u, v| 1.05 * grey((u + shift) / 4, v / 4) + 5.0);
            let frame = StereoPyramid::new(&left, &right, 2);
            let found = search_row(&frame, 200, 40, 128).unwrap();
            assert!((found - shift as f64).abs() <= 2.0, "{found} {shift}");
        }
        let stripes = Grid::from_fn(300, 80, |u, v| if (u / 8 + v / 8) % 2 == 0 { 50.0 } else { 90.0 });
        let frame = StereoPyramid::new(&stripes, &stripes, 2);
        assert_eq!(search_row(&frame, 200, 40, 128), None);
        assert_eq!(search_row(&frame, 2, 40, 128), None);
        assert_eq!(search_row(&frame, 299, 79, 128), None);
    }
}
