//! Answers of wider windows, where narrow ones have none or a much worse one.
//!
//! A window of the same number of pixels at a coarser level covers more of the image: it sees texture
//! farther away, and its noise is less.

use super::{Answer, Displacement};
use crate::geometry::Grid;
use rayon::prelude::*;

/// The wider window's answer is preferred if its variance is smaller by this factor; otherwise the
/// narrower one is nearer to the pixel's own motion.
const MUCH_BETTER: f32 = 0.25;

/// Put the answers of a level in place of what the search found there.
pub(super) fn overlay(mut found: Displacement, answers: &Grid<Answer>) -> Displacement {
    let values = found.u.values_mut().iter_mut().zip(found.v.values_mut());
    for ((u, v), answer) in values.zip(answers.values()) {
        if !answer.u.is_nan() {
            (*u, *v) = (answer.u, answer.v);
        }
    }
    found
}

/// Take over from `wide`, which is in pixels of its `level`, what it knows better.
pub(super) fn widen(flow: &mut Grid<Answer>, wide: &Grid<Answer>, level: usize) {
    let width = flow.width();
    let scale = (1_usize << level) as f32;
    flow.values_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, answer) in row.iter_mut().enumerate() {
            let other = interpolate(wide, x as f32 / scale, y as f32 / scale);
            let cov = other.cov.map(|c| scale * scale * c);
            let own = answer.cov[0] + answer.cov[2];
            let is_better = own.is_nan() || cov[0] + cov[2] < MUCH_BETTER * own;
            if is_better && !other.u.is_nan() {
                *answer = Answer { u: scale * other.u, v: scale * other.v, cov };
            }
        }
    });
}

/// Bilinear displacement at (x, y) of the plane, with the covariance of the nearest pixel: neighbours
/// share most of their error, so that their mean has no less.
fn interpolate(plane: &Grid<Answer>, x: f32, y: f32) -> Answer {
    let (right, bottom) = (plane.width() - 1, plane.height() - 1);
    let (x0, y0) = ((x as usize).min(right), (y as usize).min(bottom));
    let (a, b) = (x - x0 as f32, y - y0 as f32);
    let nearest = plane.at((x.round() as usize).min(right), (y.round() as usize).min(bottom));
    if nearest.u.is_nan() {
        return nearest;
    }
    let mut mean = Answer { u: 0.0, v: 0.0, ..nearest };
    for (dx, dy, weight) in
        [(0, 0, (1.0 - a) * (1.0 - b)), (1, 0, a * (1.0 - b)), (0, 1, (1.0 - a) * b), (1, 1, a * b)]
    {
        if weight > 0.0 {
            let corner = plane.at((x0 + dx).min(right), (y0 + dy).min(bottom));
            mean.u += weight * corner.u;
            mean.v += weight * corner.v;
        }
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wider_window_fills_holes_and_replaces_only_what_is_much_worse() {
        let answer = |u: f32, variance: f32| Answer { u, v: -u, cov: [variance, 0.0, variance] };
        let wide = Grid::from_fn(4, 4, |x, _| if x == 3 { Answer::MISSING } else { answer(x as f32, 0.01) });
        let mut flow = Grid::filled(8, 8, Answer::MISSING);
        flow.set(2, 2, answer(9.0, 0.1));
        flow.set(4, 2, answer(9.0, 0.2));
        widen(&mut flow, &wide, 1);
        assert_eq!((flow.at(1, 2).u, flow.at(1, 2).v, flow.at(1, 2).cov[0]), (1.0, -1.0, 0.04));
        assert_eq!((flow.at(2, 2).u, flow.at(4, 2).u), (9.0, 4.0));
        assert!(flow.at(6, 2).u.is_nan() && flow.at(5, 2).u.is_nan());
    }
}
