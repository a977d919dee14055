//! Forward and backward flow must undo each other.

use super::sampling::interpolate;
use super::{Answer, Displacement, FlowField};
use crate::geometry::Grid;
use rayon::prelude::*;

/// Drop what the `backward` flow (in pixels of its level) does not bring back to within `tolerance`
/// pixels of where it began.
pub(super) fn reject(flow: &mut Grid<Answer>, backward: &Displacement, level: usize, tolerance: f32) {
    let width = flow.width();
    let scale = (1_usize << level) as f32;
    flow.values_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, answer) in row.iter_mut().enumerate().filter(|(_, answer)| !answer.u.is_nan()) {
            let (tx, ty) = ((x as f32 + answer.u) / scale, (y as f32 + answer.v) / scale);
            let du = answer.u + scale * interpolate(&backward.u, tx, ty);
            let dv = answer.v + scale * interpolate(&backward.v, tx, ty);
            let agrees = du * du + dv * dv <= tolerance * tolerance;
            if !agrees {
                *answer = Answer::REFUTED;
            }
        }
    });
}

/// The same motion seen from the second image: −flow, put on the four pixels around where it leads to, so
/// that what comes nearer leaves no gaps.
///
/// Where two pixels arrive at one, the longer displacement stays: what is nearer moves more, and hides
/// what is behind.
pub(super) fn reverse(flow: &FlowField) -> FlowField {
    let (width, height) = flow.size();
    let mut back = FlowField::missing(width, height);
    for y in 0..height {
        for x in 0..width {
            let (Some(u), Some(v)) = (flow.u.get(x, y), flow.v.get(x, y)) else { continue };
            let (tx, ty) = (x as f32 + u, y as f32 + v);
            let corners = [(tx.floor(), ty.floor()), (tx.ceil(), ty.floor()), (tx.floor(), ty.ceil())];
            for (tx, ty) in corners.into_iter().chain([(tx.ceil(), ty.ceil())]) {
                let is_inside = tx >= 0.0 && ty >= 0.0 && tx < width as f32 && ty < height as f32;
                if !is_inside {
                    continue;
                }
                let (tx, ty) = (tx as usize, ty as usize);
                let stays = back.u.get(tx, ty).zip(back.v.get(tx, ty));
                if stays.is_none_or(|(a, b)| u * u + v * v > a * a + b * b) {
                    back.u.set(tx, ty, Some(-u));
                    back.v.set(tx, ty, Some(-v));
                }
            }
        }
    }
    back
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Field;

    #[test]
    fn the_reverse_leads_back_and_keeps_the_nearer() {
        let mut u = Field::missing(10, 3);
        let mut v = Field::missing(10, 3);
        for (x, du) in [(1, 4.2), (4, 1.0), (8, 5.0)] {
            u.set(x, 1, Some(du));
            v.set(x, 1, Some(1.0));
        }
        let back = reverse(&FlowField::prediction(u, v));
        assert_eq!((back.u.get(5, 2), back.v.get(5, 2)), (Some(-4.2), Some(-1.0)));
        assert_eq!(back.u.get(6, 2), Some(-4.2));
        assert_eq!(back.u.count(), 2);
    }

    #[test]
    fn what_is_not_brought_back_is_dropped() {
        let mut flow = Grid::filled(8, 8, Answer { u: 2.0, v: 2.0, cov: [1.0; 3] });
        let back = Grid::from_fn(4, 4, |x, _| if x < 2 { -1.0 } else { 1.0 });
        reject(&mut flow, &Displacement { u: back, v: Grid::filled(4, 4, -1.0) }, 1, 0.5);
        assert_eq!(flow.at(0, 3).u, 2.0);
        assert!(flow.at(4, 3).u.is_nan() && flow.at(4, 3).cov[0].is_nan());
    }
}
