//! Which winners to believe: uniqueness, left-right agreement, speckles.

use super::semi_global::Winner;
use super::subpixel::parabola;

/// The winners of a row to a fraction of a pixel, NaN where not to be believed.
///
/// To be believed a winner must be unique, and the right pixel it takes must not belong to a better
/// winner at a level that differs by more than `tolerance`. `claims` is work space.
pub(super) fn believe(row: &[Winner], tolerance: usize, claims: &mut Vec<u32>, believed: &mut [f32]) {
    // Of each right pixel: the cost of the best left pixel that won with it (high half), and its level.
    claims.clear();
    claims.resize(row.len(), u32::MAX);
    for (u, winner) in row.iter().enumerate() {
        let claim = u32::from(winner.costs[1]) << 16 | u32::from(winner.level);
        if let Some(best) = claims.get_mut(u.wrapping_sub(winner.level.into())) {
            *best = claim.min(*best);
        }
    }
    for ((u, winner), believed) in row.iter().enumerate().zip(believed) {
        let claim = claims.get(u.wrapping_sub(winner.level.into()));
        let agrees =
            claim.is_some_and(|&claim| usize::from((claim as u16).abs_diff(winner.level)) <= tolerance);
        *believed =
            if agrees && winner.unique { f32::from(winner.level) + parabola(winner.costs) } else { f32::NAN };
    }
}
