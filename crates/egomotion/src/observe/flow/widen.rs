//! Answers of wider windows, where narrow ones have none or a much worse one.
//!
//! A window of the same number of pixels at a coarser level covers more of the image: it sees texture
//! farther away, and its noise is less.

use super::sampling::interpolate;
use super::{Displacement, FlowField};

/// The wider window's answer is preferred if its variance is smaller by this factor; otherwise the
/// narrower one is nearer to the pixel's own motion.
const MUCH_BETTER: f32 = 0.25;

/// Put the answers of a level in place of what the search found there.
pub(super) fn overlay(mut found: Displacement, answers: &FlowField) -> Displacement {
    let pairs = [(&mut found.u, &answers.u), (&mut found.v, &answers.v)];
    for (value, answer) in
        pairs.into_iter().flat_map(|(f, a)| f.values_mut().iter_mut().zip(a.grid().values()))
    {
        if !answer.is_nan() {
            *value = *answer;
        }
    }
    found
}

/// Take over from `wide`, which is in pixels of its `level`, what it knows better.
pub(super) fn widen(flow: &mut FlowField, wide: &FlowField, level: usize) {
    let (width, height) = flow.size();
    let scale = (1_usize << level) as f32;
    for y in 0..height {
        for x in 0..width {
            let at = ((x as f32 / scale).round() as usize, (y as f32 / scale).round() as usize);
            let at = (at.0.min(wide.u.width() - 1), at.1.min(wide.u.height() - 1));
            let cov = [&wide.cov_uu, &wide.cov_uv, &wide.cov_vv].map(|c| scale * scale * c.at(at.0, at.1));
            let own = flow.cov_uu.at(x, y) + flow.cov_vv.at(x, y);
            if cov[0].is_nan() || cov[0] + cov[2] >= MUCH_BETTER * own {
                continue;
            }
            let (tx, ty) = (x as f32 / scale, y as f32 / scale);
            let u = scale * interpolate(wide.u.grid(), tx, ty);
            let v = scale * interpolate(wide.v.grid(), tx, ty);
            if u.is_nan() {
                continue;
            }
            flow.u.set(x, y, Some(u));
            flow.v.set(x, y, Some(v));
            flow.cov_uu.set(x, y, cov[0]);
            flow.cov_uv.set(x, y, cov[1]);
            flow.cov_vv.set(x, y, cov[2]);
        }
    }
}
