//! Square windows of an image read between its pixels, laid out for vectors.

use super::spline;
use crate::geometry::Image;

/// Half the side of a window, in pixels.
pub const RADIUS: usize = 5;
/// Side of a window.
pub(super) const SIDE: usize = 2 * RADIUS + 1;
/// A row of a window fills two vectors of eight; what lies beyond the window's side has no meaning.
pub(super) const LANES: usize = 16;
/// Source columns that a row of lanes needs.
const SPAN: usize = LANES + 3;
/// Magnifications below about a quarter do not fit; a patch that shrinks more is not followed.
const LONGEST: usize = 64;

/// The values of a window.
pub(super) type Window = [[f32; LANES]; SIDE];

/// N rows of N pixels around (u, v) from spline coefficients; `None` unless the window lies inside with a margin.
#[inline(always)]
pub(super) fn sample<const N: usize>(image: &Image, u: f64, v: f64) -> Option<[[f32; LANES]; N]> {
    let (left, wu) = first(u, N, image.width())?;
    let (top, wv) = first(v, N, image.height())?;
    // Horizontally first: the rows then meet in whole vectors.
    let mut lines = [[0.0_f32; LANES]; LANES];
    for (row, line) in lines[..N + 3].iter_mut().enumerate() {
        // Reads past the end of a row end up in the lanes without a meaning.
        let source = image.values().get((top + row) * image.width() + left..)?.first_chunk::<SPAN>()?;
        for i in 0..LANES {
            line[i] =
                wu[0] * source[i] + wu[1] * source[i + 1] + wu[2] * source[i + 2] + wu[3] * source[i + 3];
        }
    }
    let mut out = [[0.0_f32; LANES]; N];
    for (row, out) in out.iter_mut().enumerate() {
        let [a, b, c, d] = [&lines[row], &lines[row + 1], &lines[row + 2], &lines[row + 3]];
        for i in 0..LANES {
            out[i] = wv[0] * a[i] + wv[1] * b[i] + wv[2] * c[i] + wv[3] * d[i];
        }
    }
    Some(out)
}

/// First coefficient and weights of a line of N pixels around `centre` on an axis of `length`.
#[inline(always)]
fn first(centre: f64, n: usize, length: usize) -> Option<(usize, [f32; 4])> {
    let at = centre - (n / 2) as f64;
    if !(at >= 1.0 && at + (n as f64 + 1.0) < length as f64) {
        return None;
    }
    Some((at as usize - 1, spline::weights((at - at.floor()) as f32)))
}

/// The same with pixels `spacing` apart.
#[inline(always)]
pub(super) fn sample_spaced<const N: usize>(
    image: &Image,
    u: f64,
    v: f64,
    spacing: f64,
) -> Option<[[f32; LANES]; N]> {
    let half = (N / 2) as f64 * spacing;
    let (width, height) = image.size();
    let inside = |c: f64, n: usize| c - half >= 1.0 && c + half < n as f64 - 2.0;
    if !(inside(u, width) && inside(v, height)) {
        return None;
    }
    let place = |c: f64, k: usize| {
        let at = c - half + k as f64 * spacing;
        (at as usize - 1, spline::weights((at - at.floor()) as f32))
    };
    let columns: [(usize, [f32; 4]); N] = std::array::from_fn(|k| place(u, k));
    let first = columns[0].0;
    let span = columns[N - 1].0 + 4 - first;
    let mut line = [0.0_f32; LONGEST];
    let line = line.get_mut(..span)?;
    let mut out = [[0.0_f32; LANES]; N];
    for (row, out) in out.iter_mut().enumerate() {
        let (top, w) = place(v, row);
        let source: [&[f32]; 4] = std::array::from_fn(|k| &image.row(top + k)[first..first + span]);
        for (i, value) in line.iter_mut().enumerate() {
            *value = w[0] * source[0][i] + w[1] * source[1][i] + w[2] * source[2][i] + w[3] * source[3][i];
        }
        for (value, (at, w)) in out.iter_mut().zip(&columns) {
            let s = &line[at - first..at - first + 4];
            *value = w[0] * s[0] + w[1] * s[1] + w[2] * s[2] + w[3] * s[3];
        }
    }
    Some(out)
}
