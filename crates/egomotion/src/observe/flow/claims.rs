//! One place of the second image shows one place of the first: of two that claim it the worse is hidden.

use super::guided::{Coarse, RESIDUAL};
use crate::geometry::Grid;
use rayon::prelude::*;

/// Places this far apart, in pixels of the level, are different ones.
const APART: usize = 2;
/// The residual of the one must be lower by this factor for the other to count as hidden.
const CLEARLY_LOWER: f32 = 0.5;

/// Mark what is hidden with an infinite residual.
pub(super) fn hide_claimed(coarse: &mut Coarse) {
    let (width, height) = coarse.size();
    let mut claims = Grid::filled(width, height, (f32::INFINITY, 0_u32));
    for y in 0..height {
        let row = coarse.row(0, y).iter().zip(coarse.row(1, y)).zip(coarse.row(RESIDUAL, y));
        for (x, ((&u, &v), &residual)) in row.enumerate() {
            if let Some(at) = target((width, height), (x, y), (u, v))
                && residual < claims.at(at.0, at.1).0
            {
                claims.set(at.0, at.1, (residual, (y * width + x) as u32));
            }
        }
    }
    coarse.strips(1).into_par_iter().enumerate().for_each(|(y, planes)| {
        let [us, vs, .., residuals, _] = planes;
        for (x, residual) in residuals.iter_mut().enumerate() {
            let Some(at) = target((width, height), (x, y), (us[x], vs[x])) else { continue };
            let (least, owner) = claims.at(at.0, at.1);
            let (ox, oy) = (owner as usize % width, owner as usize / width);
            if ox.abs_diff(x).max(oy.abs_diff(y)) > APART && least < CLEARLY_LOWER * *residual {
                *residual = f32::INFINITY;
            }
        }
    });
}

/// The pixel of the second image that a measured one goes to, if inside.
fn target(size: (usize, usize), (x, y): (usize, usize), (u, v): (f32, f32)) -> Option<(usize, usize)> {
    let (tx, ty) = (x as f32 + u + 0.5, y as f32 + v + 0.5);
    (tx >= 0.0 && ty >= 0.0 && tx < size.0 as f32 && ty < size.1 as f32).then_some((tx as usize, ty as usize))
}
