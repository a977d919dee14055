//! One place of the second image shows one place of the first: of two that claim it the worse is hidden.

use super::guided::{Coarse, RESIDUAL};
use crate::geometry::Grid;

/// Places this far apart, in pixels of the level, are different ones.
const APART: i32 = 2;
/// The residual of the one must be lower by this factor for the other to count as hidden.
const CLEARLY_LOWER: f32 = 0.5;

/// Mark what is hidden with an infinite residual.
pub(super) fn hide_claimed(coarse: &mut Coarse) {
    let (width, height) = coarse.size();
    let mut claims = Grid::filled(width, height, (f32::INFINITY, 0_u32));
    for y in 0..height {
        for x in 0..width {
            let residual = coarse.at(RESIDUAL, x, y);
            if let Some((tx, ty)) = target(coarse, x, y)
                && residual < claims.at(tx, ty).0
            {
                claims.set(tx, ty, (residual, (y * width + x) as u32));
            }
        }
    }
    let hidden = |coarse: &Coarse, x: usize, y: usize| {
        target(coarse, x, y).is_some_and(|(tx, ty)| {
            let (residual, owner) = claims.at(tx, ty);
            let (ox, oy) = (owner as i32 % width as i32, owner as i32 / width as i32);
            let apart = (ox - x as i32).abs().max((oy - y as i32).abs());
            apart > APART && residual < CLEARLY_LOWER * coarse.at(RESIDUAL, x, y)
        })
    };
    for y in 0..height {
        let row: Vec<bool> = (0..width).map(|x| hidden(coarse, x, y)).collect();
        for (residual, _) in coarse.row_mut(RESIDUAL, y).iter_mut().zip(row).filter(|(_, hidden)| *hidden) {
            *residual = f32::INFINITY;
        }
    }
}

/// The pixel of the second image that a measured one goes to, if inside.
fn target(coarse: &Coarse, x: usize, y: usize) -> Option<(usize, usize)> {
    let (tx, ty) = ((x as f32 + coarse.at(0, x, y)).round(), (y as f32 + coarse.at(1, x, y)).round());
    let (width, height) = coarse.size();
    (tx >= 0.0 && ty >= 0.0 && tx < width as f32 && ty < height as f32).then_some((tx as usize, ty as usize))
}
