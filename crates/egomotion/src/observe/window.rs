//! Square windows of an image read between its pixels, laid out for vectors, and sums over them.

use super::spline;
use crate::geometry::Image;
use crate::simd::vectorised;

/// Half the side of a window, in pixels.
pub(super) const RADIUS: usize = 5;
/// Side of a window, in pixels.
pub(super) const SIDE: usize = 2 * RADIUS + 1;
/// A row of a window fills two vectors of eight; what lies beyond the window's side has no meaning.
pub(super) const LANES: usize = 16;
/// Source columns that a row of lanes needs, with three more for the spline.
const SPAN: usize = LANES + 3;
/// Source pixels of a line that is read with a spacing: magnifications below about a quarter do not fit, and a patch that
/// shrinks more is not followed.
const LONGEST_LINE: usize = 64;

/// Number of pixels of a window.
pub(super) const PIXELS: f32 = (SIDE * SIDE) as f32;
/// Standard deviation below which a window has no contrast, in grey levels.
const LEAST_CONTRAST: f32 = 0.1;

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
    let mut line = [0.0_f32; LONGEST_LINE];
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

/// 1 in the lanes that belong to the window.
pub(super) const ONES: Window = {
    let mut row = [0.0; LANES];
    let mut i = 0;
    while i < SIDE {
        row[i] = 1.0;
        i += 1;
    }
    [row; SIDE]
};

#[inline(always)]
pub(super) fn dot(a: &Window, b: &Window) -> f64 {
    let mut sum = [0.0_f32; LANES];
    for row in 0..SIDE {
        for i in 0..LANES {
            sum[i] += a[row][i] * b[row][i];
        }
    }
    total(&sum)
}

vectorised! {
/// Σ of a², a b and b² of two windows smoothed by (1 2 1)/4 in both directions, zero around them.
pub(super) smoothed_products(a: &Window, b: &Window) -> [f64; 3] {
    let (a, b) = (smoothed(a), smoothed(b));
    let mut sums = [[0.0_f32; LANES]; 3];
    for row in 0..SIDE + 2 {
        for i in 0..LANES {
            sums[0][i] += a[row][i] * a[row][i];
            sums[1][i] += a[row][i] * b[row][i];
            sums[2][i] += b[row][i] * b[row][i];
        }
    }
    sums.map(|sum| {
        let mut all = 0.0;
        for lane in &sum {
            all += lane;
        }
        f64::from(all)
    })
}
}

/// The window with a margin of one pixel, which lies in lane 15 on its left side.
#[inline(always)]
fn smoothed(window: &Window) -> [[f32; LANES]; SIDE + 2] {
    let mut out = [[0.0_f32; LANES]; SIDE + 2];
    for (row, values) in window.iter().enumerate() {
        let mut line = [0.0_f32; LANES];
        for i in 0..LANES {
            line[i] = 0.25 * (values[(i + LANES - 1) % LANES] + values[(i + 1) % LANES]) + 0.5 * values[i];
        }
        for i in 0..LANES {
            out[row][i] += 0.25 * line[i];
            out[row + 1][i] += 0.5 * line[i];
            out[row + 2][i] += 0.25 * line[i];
        }
    }
    out
}

/// Sum over the lanes that belong to the window.
#[inline(always)]
pub(super) fn total(lanes: &[f32; LANES]) -> f64 {
    let mut sum = 0.0;
    for lane in &lanes[..SIDE] {
        sum += lane;
    }
    f64::from(sum)
}

/// Reduce to zero mean; the standard deviation, or `None` if it vanishes.
#[inline(always)]
pub(super) fn standardise(values: &mut Window) -> Option<f32> {
    let mut sum = [0.0_f32; LANES];
    for row in values.iter() {
        for i in 0..LANES {
            sum[i] += row[i];
        }
    }
    let mean = total(&sum) as f32 / PIXELS;
    let mut square = [0.0_f32; LANES];
    for row in values.iter_mut() {
        for i in 0..LANES {
            row[i] -= mean;
            square[i] += row[i] * row[i];
        }
    }
    let deviation = (total(&square) as f32 / PIXELS).sqrt();
    (deviation > LEAST_CONTRAST && deviation.is_finite()).then_some(deviation)
}
