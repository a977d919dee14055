//! Answers of wider windows, where narrow ones see too little texture.
//!
//! A window of the same number of pixels at a coarser level covers more of the image: it sees texture
//! farther away, and its noise is less.

use super::Answer;
use crate::geometry::Grid;
use rayon::prelude::*;

/// Take over from `wide`, which is in pixels of its `level`, what is unknown.
pub(super) fn widen(flow: &mut Grid<Answer>, wide: &Grid<Answer>, level: usize) {
    let width = flow.width();
    let scale = (1_usize << level) as f32;
    flow.values_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let unknown = |answer: &Answer| answer.cov[0] == f32::INFINITY;
        for (x, answer) in row.iter_mut().enumerate().filter(|(_, answer)| unknown(answer)) {
            let Answer { u, v, cov } = interpolate(wide, x as f32 / scale, y as f32 / scale);
            if !u.is_nan() {
                *answer = Answer { u: scale * u, v: scale * v, cov: cov.map(|c| scale * scale * c) };
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
    fn the_wider_window_answers_only_what_is_unknown() {
        let answer = |u: f32| Answer { u, v: -u, cov: [0.01, 0.0, 0.01] };
        let wide = Grid::from_fn(4, 4, |x, _| if x == 3 { Answer::REFUTED } else { answer(x as f32) });
        let mut flow = Grid::filled(8, 8, Answer::UNKNOWN);
        flow.set(2, 2, answer(9.0));
        flow.set(3, 2, Answer::REFUTED);
        widen(&mut flow, &wide, 1);
        assert_eq!((flow.at(1, 2).u, flow.at(1, 2).v, flow.at(1, 2).cov[0]), (1.0, -1.0, 0.04));
        assert_eq!((flow.at(2, 2).u, flow.at(4, 2).u), (9.0, 4.0));
        assert!([3, 5, 6, 7].iter().all(|&x| flow.at(x, 2).u.is_nan()));
    }
}
