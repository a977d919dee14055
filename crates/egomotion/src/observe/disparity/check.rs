//! Which winners to believe: uniqueness, left-right agreement, speckles.

/// Whether the cost of `best` stands out from all but its two neighbours by the fraction `margin`.
///
/// A winner without a rival to compare with is not unique.
pub(super) fn is_unique(costs: &[u16], best: usize, margin: f32) -> bool {
    let before = costs[..best.saturating_sub(1)].iter().min();
    let after = costs.get(best + 2..).unwrap_or_default().iter().min();
    let rival = before.into_iter().chain(after).min();
    rival.is_some_and(|&rival| f32::from(rival) * (1.0 - margin) > f32::from(costs[best]))
}

/// The winners of one row of the right image, read from the costs of the left one.
///
/// Entry `i` belongs to the right pixel `width − 1 − i`: reversed, so that the costs of one left
/// pixel fall on consecutive entries.
#[derive(Debug, Clone, Default)]
pub(super) struct RightWinners {
    costs: Vec<u16>,
    levels: Vec<u16>,
}

impl RightWinners {
    /// Forget the last row.
    pub(super) fn start_row(&mut self, width: usize) {
        self.costs.clear();
        self.costs.resize(width, u16::MAX);
        self.levels.clear();
        self.levels.resize(width, 0);
    }

    /// Offer the costs of left pixel `u`, of the levels 0 … that stay inside the right image.
    pub(super) fn offer(&mut self, u: usize, costs: &[u16]) {
        let first = self.costs.len() - 1 - u;
        let bests = &mut self.costs[first..first + costs.len()];
        let levels = &mut self.levels[first..first + costs.len()];
        for (level, ((best, winner), &cost)) in (0_u16..).zip(bests.iter_mut().zip(levels).zip(costs)) {
            let better = cost < *best;
            *winner = if better { level } else { *winner };
            *best = if better { cost } else { *best };
        }
    }

    /// Whether the right pixel that left pixel `u` found at `level` found it too, within `tolerance` levels.
    pub(super) fn agree(&self, u: usize, level: usize, tolerance: usize) -> bool {
        let entry = self.levels.len() - 1 - u + level;
        self.levels.get(entry).is_some_and(|&back| usize::from(back).abs_diff(level) <= tolerance)
    }
}

/// Remove (set to NaN) connected pieces of fewer than `size` pixels.
///
/// Two of the four-neighbours are connected if they differ by at most `range`. `values` is
/// row-major with rows of `width`; `pieces` and `stack` are work space.
pub(super) fn remove_speckles(
    values: &mut [f32],
    width: usize,
    size: usize,
    range: f32,
    pieces: &mut Speckles,
) {
    let Speckles { seen, piece } = pieces;
    seen.clear();
    seen.resize(values.len(), false);
    for start in 0..values.len() {
        if seen[start] || values[start].is_nan() {
            continue;
        }
        piece.clear();
        piece.push(start as u32);
        seen[start] = true;
        let mut next = 0;
        while let Some(&pixel) = piece.get(next) {
            next += 1;
            let pixel = pixel as usize;
            let column = pixel % width;
            let neighbours = [
                (column > 0).then(|| pixel - 1),
                (column + 1 < width).then_some(pixel + 1),
                pixel.checked_sub(width),
                (pixel + width < values.len()).then_some(pixel + width),
            ];
            for neighbour in neighbours.into_iter().flatten() {
                if !seen[neighbour] && (values[neighbour] - values[pixel]).abs() <= range {
                    seen[neighbour] = true;
                    piece.push(neighbour as u32);
                }
            }
        }
        if piece.len() < size {
            piece.iter().for_each(|&pixel| values[pixel as usize] = f32::NAN);
        }
    }
}

/// Work space of [`remove_speckles`].
#[derive(Debug, Clone, Default)]
pub(super) struct Speckles {
    seen: Vec<bool>,
    piece: Vec<u32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_clear_minimum_is_unique() {
        assert!(is_unique(&[90, 60, 50, 55, 80], 2, 0.1));
        assert!(!is_unique(&[54, 60, 50, 55, 80], 2, 0.1));
        assert!(!is_unique(&[0, 0, 0, 0], 0, 0.1));
        assert!(!is_unique(&[3, 9], 0, 0.1));
    }

    #[test]
    fn the_right_row_keeps_its_best_left_pixel() {
        let mut right = RightWinners::default();
        right.start_row(4);
        right.offer(2, &[9, 9, 3]);
        right.offer(3, &[9, 9, 9, 4]);
        assert!(right.agree(2, 2, 0));
        assert!(!right.agree(3, 3, 0));
        assert!(right.agree(3, 3, 1));
    }

    #[test]
    fn speckles_go_and_surfaces_stay() {
        let mut values = vec![1.0, 1.5, 9.0, 2.0, 1.8, f32::NAN, 2.4, 2.0, 30.0];
        remove_speckles(&mut values, 3, 2, 0.6, &mut Speckles::default());
        let kept: Vec<bool> = values.iter().map(|v| !v.is_nan()).collect();
        assert_eq!(kept, [true, true, false, true, true, false, true, true, false]);
    }
}
