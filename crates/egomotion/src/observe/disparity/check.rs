//! Which winners to believe: uniqueness, left-right agreement, speckles.

use super::subpixel::parabola;

/// The level of least cost of a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Winner {
    /// The level.
    pub level: u16,
    /// Cost of the level below, of the level, and of the one above; [`NO_LEVEL`] where there is none.
    pub costs: [u16; 3],
    /// Whether no other level but its neighbours is about as cheap.
    pub unique: bool,
}

/// The cost of a level that does not exist.
pub(super) const NO_LEVEL: u16 = u16::MAX;

/// What left pixels claim each pixel of the right row with: the cost (high half) and the level of the
/// best of them. The last right pixel comes first, so that one left pixel's levels stand side by side.
#[derive(Debug, Clone, Default)]
pub(super) struct Claims(pub Vec<u32>);

impl Claims {
    /// Forget the last row.
    pub fn start_row(&mut self, width: usize) {
        self.0.clear();
        self.0.resize(width, u32::MAX);
    }

    /// Every winner claims its right pixel.
    pub fn of_winners(&mut self, row: &[Winner]) {
        self.start_row(row.len());
        for (u, winner) in row.iter().enumerate() {
            let claim = u32::from(winner.costs[1]) << 16 | u32::from(winner.level);
            if let Some(best) = self.0.get_mut(row.len() - 1 - u + usize::from(winner.level)) {
                *best = claim.min(*best);
            }
        }
    }

    /// Whether the right pixel of left pixel `u` at `level` is claimed at that level, within
    /// `tolerance`; never outside the right image.
    pub fn agree(&self, u: usize, level: u16, tolerance: usize) -> bool {
        let claim = self.0.get(self.0.len() - 1 - u + usize::from(level));
        claim.is_some_and(|&claim| usize::from((claim as u16).abs_diff(level)) <= tolerance)
    }
}

/// The winners of a row to a fraction of a pixel, NaN where not to be believed.
///
/// To be believed a winner must be unique, and the right pixel it takes must not belong to a better
/// match at a level that differs by more than `tolerance`.
pub(super) fn believe(row: &[Winner], tolerance: usize, claims: &Claims, believed: &mut [f32]) {
    for ((u, winner), believed) in row.iter().enumerate().zip(believed) {
        let agrees = claims.agree(u, winner.level, tolerance);
        *believed =
            if agrees && winner.unique { f32::from(winner.level) + parabola(winner.costs) } else { f32::NAN };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_pixel_keeps_its_best_left_pixel() {
        let winner = |level, cost| Winner { level, costs: [99, cost, 99], unique: true };
        // Left pixels 3 and 5 both claim right pixel 2; left pixel 0 lies outside at level 1.
        let row = [winner(1, 1), winner(0, 5), winner(0, 50), winner(1, 7), winner(0, 5), winner(3, 4)];
        let mut claims = Claims::default();
        claims.of_winners(&row);
        let mut believed = [0.0; 6];
        believe(&row, 1, &claims, &mut believed);
        let kept: Vec<bool> = believed.iter().map(|d| !d.is_nan()).collect();
        assert_eq!(kept, [false, true, false, false, true, true]);
        believe(&row, 2, &claims, &mut believed);
        assert_eq!(believed[3], 1.0);
    }
}
