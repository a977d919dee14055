//! Which winners to believe: uniqueness, left-right agreement, speckles.

/// Whether the cost of `best` stands out from all but its two neighbours by the fraction `margin`.
///
/// A winner without a rival to compare with is not unique.
pub(super) fn is_unique(costs: &[u16], best: usize, margin: f32) -> bool {
    let least = |costs: &[u16]| costs.iter().copied().fold(u16::MAX, u16::min);
    let before = &costs[..best.saturating_sub(1)];
    let after = costs.get(best + 2..).unwrap_or_default();
    let rival = least(before).min(least(after));
    !(before.is_empty() && after.is_empty()) && f32::from(rival) * (1.0 - margin) > f32::from(costs[best])
}

/// What one row of the right image was matched to: for each of its pixels the best of the left
/// pixels that won with it.
#[derive(Debug, Clone, Default)]
pub(super) struct RightWinners(Vec<(u16, u16)>);

impl RightWinners {
    /// Forget the last row.
    pub(super) fn start_row(&mut self, width: usize) {
        self.0.clear();
        self.0.resize(width, (u16::MAX, 0));
    }

    /// Left pixel `u` won at `level` with `cost`.
    pub(super) fn claim(&mut self, u: usize, level: usize, cost: u16) {
        if let Some(best) = u.checked_sub(level).and_then(|u| self.0.get_mut(u)) {
            *best = (*best).min((cost, level as u16));
        }
    }

    /// Whether the right pixel that left pixel `u` won at `level` was won at that level, within
    /// `tolerance`; never outside the right image.
    pub(super) fn agree(&self, u: usize, level: usize, tolerance: usize) -> bool {
        let best = u.checked_sub(level).and_then(|u| self.0.get(u));
        best.is_some_and(|&(_, won)| usize::from(won).abs_diff(level) <= tolerance)
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
    fn a_right_pixel_keeps_its_best_left_pixel() {
        let mut right = RightWinners::default();
        right.start_row(6);
        right.claim(3, 1, 7);
        right.claim(5, 3, 4);
        assert!(right.agree(5, 3, 0));
        assert!(!right.agree(3, 1, 1));
        assert!(right.agree(3, 1, 2));
        assert!(!right.agree(2, 3, 9));
    }

    #[test]
    fn speckles_go_and_surfaces_stay() {
        let mut values = vec![1.0, 1.5, 9.0, 2.0, 1.8, f32::NAN, 2.4, 2.0, 30.0];
        remove_speckles(&mut values, 3, 2, 0.6, &mut Speckles::default());
        let kept: Vec<bool> = values.iter().map(|v| !v.is_nan()).collect();
        assert_eq!(kept, [true, true, false, true, true, false, true, true, false]);
    }
}
