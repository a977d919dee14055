//! Two images of one level compared at a displacement of each pixel, row by row.

use crate::geometry::Image;
use crate::observe::spline;
use crate::simd::vectorised;

/// Pixels handled at a time: what they need stays in the fastest cache.
pub(super) const TILE: usize = 64;

/// The images of one level: the first one's grey levels, the second one's spline coefficients.
#[derive(Debug, Clone, Copy)]
pub(super) struct LevelImages<'a> {
    pub from: &'a Image,
    pub to: &'a Image,
}

/// A row of both images compared, with a margin of zeros at either end that windows may reach into.
#[derive(Debug, Clone)]
pub(super) struct ComparedRow {
    /// 1 where the second image shows the pixel, else 0, as everything that follows.
    pub known: Vec<f32>,
    /// ∂I/∂u and ∂I/∂v of the first image, in grey levels per pixel.
    pub slope_u: Vec<f32>,
    pub slope_v: Vec<f32>,
    /// Second minus first image, in grey levels.
    pub difference: Vec<f32>,
    /// The displacement compared at, in pixels; without a margin.
    pub u: Vec<f32>,
    pub v: Vec<f32>,
}

impl ComparedRow {
    /// Zeros, for rows of `width` pixels and windows of the radius.
    pub(super) fn new(width: usize, radius: usize) -> Self {
        let row = || vec![0.0; width.next_multiple_of(TILE) + 2 * radius + TILE];
        let plain = || vec![0.0; width.next_multiple_of(TILE)];
        Self { known: row(), slope_u: row(), slope_v: row(), difference: row(), u: plain(), v: plain() }
    }

    /// Compare row `y` at the displacements `u`, `v`; the margin before the first pixel is `radius`.
    pub(super) fn compare(&mut self, images: LevelImages<'_>, y: usize, radius: usize) {
        let (width, height) = images.from.size();
        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| images.from.row(y));
        let inner = radius..radius + width;
        slopes(rows, &mut self.slope_u[inner.clone()], &mut self.slope_v[inner.clone()]);
        let at = (&self.u[..width], &self.v[..width]);
        let out = [&mut self.known, &mut self.slope_u, &mut self.slope_v, &mut self.difference]
            .map(|row| &mut row[inner.clone()]);
        differences(rows[1], images.to, y, at, out);
    }
}

vectorised! {
/// Scharr's derivatives of the middle row, as `pyramid::gradients` has them.
slopes(rows: [&[f32]; 3], du: &mut [f32], dv: &mut [f32]) {
    let n = du.len();
    let [above, here, below] = rows.map(|row| &row[..n]);
    let dv = &mut dv[..n];
    for x in 1..n.saturating_sub(1) {
        let across = |k: usize| 3.0 * (above[k] + below[k]) + 10.0 * here[k];
        let down = |k: usize| below[k] - above[k];
        du[x] = (0.5 / 16.0) * (across(x + 1) - across(x - 1));
        dv[x] = (0.5 / 16.0) * (3.0 * (down(x - 1) + down(x + 1)) + 10.0 * down(x));
    }
    for x in [0, n - 1] {
        let (left, right) = (x.saturating_sub(1), (x + 1).min(n - 1));
        let across = |k: usize| 3.0 * (above[k] + below[k]) + 10.0 * here[k];
        let down = |k: usize| below[k] - above[k];
        du[x] = (0.5 / 16.0) * (across(right) - across(left));
        dv[x] = (0.5 / 16.0) * (3.0 * (down(left) + down(right)) + 10.0 * down(x));
    }
}
}

vectorised! {
/// ComparedRow of a row; slopes become 0 where the second image has no counterpart.
differences(grey: &[f32], to: &Image, y: usize, at: (&[f32], &[f32]), out: [&mut [f32]; 4]) {
    let (width, height) = to.size();
    let [known, du, dv, difference] = out;
    let coefficients = to.values();
    for first in (0..width).step_by(TILE) {
        let here = first..(first + TILE).min(width);
        let n = here.len();
        let [mut u, mut v] = [[0.0_f32; TILE]; 2];
        u[..n].copy_from_slice(&at.0[here.clone()]);
        v[..n].copy_from_slice(&at.1[here.clone()]);
        let mut place = [0_u32; TILE];
        let mut inside = [0.0_f32; TILE];
        let [mut wu, mut wv] = [[[0.0_f32; TILE]; 4]; 2];
        // The last places that have four coefficients each way around them.
        let (last_u, last_v) = (width as f32 - 2.0, height as f32 - 2.0);
        for i in 0..TILE {
            let (pu, pv) = ((first + i) as f32 + u[i], y as f32 + v[i]);
            let is_inside = (pu >= 1.0) & (pv >= 1.0) & (pu < last_u) & (pv < last_v);
            inside[i] = if is_inside { 1.0 } else { 0.0 };
            let (pu, pv) = if is_inside { (pu, pv) } else { (1.0, 1.0) };
            let (u0, v0) = (pu as i32, pv as i32);
            place[i] = ((v0 - 1) * width as i32 + u0 - 1) as u32;
            let weights = [spline::weights(pu - u0 as f32), spline::weights(pv - v0 as f32)];
            for k in 0..4 {
                wu[k][i] = weights[0][k];
                wv[k][i] = weights[1][k];
            }
        }
        let mut moved = [0.0_f32; TILE];
        for i in 0..n {
            let start = place[i] as usize;
            let mut line = [0.0_f32; 4];
            for (k, wv) in wv.iter().enumerate() {
                let Some(four) = coefficients.get(start + k * width..start + k * width + 4) else { continue };
                for j in 0..4 {
                    line[j] += wv[i] * four[j];
                }
            }
            moved[i] = (wu[0][i] * line[0] + wu[1][i] * line[1]) + (wu[2][i] * line[2] + wu[3][i] * line[3]);
        }
        let grey = &grey[here.clone()];
        let (known, difference) = (&mut known[here.clone()], &mut difference[here.clone()]);
        let (du, dv) = (&mut du[here.clone()], &mut dv[here]);
        for i in 0..n {
            known[i] = inside[i];
            difference[i] = inside[i] * (moved[i] - grey[i]);
            du[i] *= inside[i];
            dv[i] *= inside[i];
        }
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;
    use crate::observe::pyramid::gradients;

    #[test]
    fn rows_are_what_spline_and_gradients_say() {
        let image =
            |shift: usize| Grid::from_fn(90, 20, |u, v| ((u * 37 + v * 91 + u * v * shift) % 50) as f32);
        let (from, to) = (image(1), spline::coefficients(&image(2)));
        let slopes = gradients(&from);
        for y in [0, 7, 19] {
            let mut row = ComparedRow::new(90, 4);
            for x in 0..90 {
                (row.u[x], row.v[x]) = (0.3 * x as f32 - 11.0, 0.07 * x as f32 - 2.6);
            }
            row.compare(LevelImages { from: &from, to: &to }, y, 4);
            assert!(row.known[..4].iter().chain(&row.known[94..]).all(|&k| k == 0.0));
            let mut compared = 0;
            for x in 0..90 {
                let (pu, pv) = (x as f32 + row.u[x], y as f32 + row.v[x]);
                let is_inside = (1.0..88.0).contains(&pu) && (1.0..18.0).contains(&pv);
                assert_eq!(row.known[x + 4], if is_inside { 1.0 } else { 0.0 });
                if is_inside {
                    let expected = spline::sample(&to, pu, pv).unwrap() - from.at(x, y);
                    assert!((row.difference[x + 4] - expected).abs() < 1e-3);
                    assert!((row.slope_u[x + 4] - slopes.du.at(x, y)).abs() < 1e-4);
                    assert!((row.slope_v[x + 4] - slopes.dv.at(x, y)).abs() < 1e-4);
                    compared += 1;
                }
            }
            assert!(compared > 10);
        }
    }
}
