//! Cubic B-splines: an image read between its pixels almost without loss of contrast.
//!
//! A four-tap kernel on the grey levels themselves attenuates fine texture half-way between pixels
//! by a tenth and more, which biases every sub-pixel match. The same four taps on the spline's
//! *coefficients* pass through the grey levels and lose a quarter of that (Unser, Aldroubi and
//! Eden 1993).

use rayon::prelude::*;

use super::pyramid::fill_rows;
use crate::geometry::{Grid, Image};
use crate::simd::vectorised;

/// The pole of the cubic B-spline's inverse filter, √3 − 2.
const POLE: f32 = -0.267_949_2;
/// Columns that are filtered together down the image: wide enough for vectors, and narrow enough for the cache.
const STRIP_COLUMNS: usize = 64;
/// Pixels after which the influence of one is below single precision.
const REACH: usize = 12;
/// Reach of the filter that smooths and inverts at once, in pixels: beyond it lie 2·10⁻⁴ of the weight.
const TAPS: usize = 6;

/// Weights of the four coefficients around the fraction `t` (0 … 1) of a pixel.
#[inline(always)]
pub(super) fn weights(t: f32) -> [f32; 4] {
    let (s, t2) = (1.0 - t, t * t);
    let (a, d) = (s * s * s / 6.0, t2 * t / 6.0);
    [a, 2.0 / 3.0 - t2 + 0.5 * t2 * t, 2.0 / 3.0 - s * s + 0.5 * s * s * s, d]
}

/// Coefficients along rows only, for reading between the pixels of a row.
pub(super) fn row_coefficients(image: &Image) -> Image {
    let mut out = image.clone();
    let width = image.width().max(1);
    out.values_mut().par_chunks_mut(width).for_each(filter);
    out
}

/// Coefficients in both directions, mirrored at the borders.
pub(super) fn coefficients(image: &Image) -> Image {
    let mut out = row_coefficients(image);
    let (width, height) = out.size();
    let strips: Vec<Vec<f32>> = (0..width.div_ceil(STRIP_COLUMNS))
        .into_par_iter()
        .map(|strip| {
            let first = strip * STRIP_COLUMNS;
            let count = STRIP_COLUMNS.min(width - first);
            let mut rows: Vec<f32> =
                (0..height).flat_map(|v| out.row(v)[first..first + count].iter().copied()).collect();
            filter_rows(&mut rows, count);
            rows
        })
        .collect();
    for (strip, rows) in strips.iter().enumerate() {
        let (first, count) = (strip * STRIP_COLUMNS, STRIP_COLUMNS.min(width - strip * STRIP_COLUMNS));
        for (v, row) in rows.chunks_exact(count).enumerate() {
            out.row_mut(v)[first..first + count].copy_from_slice(row);
        }
    }
    out
}

/// Coefficients in both directions of the image smoothed by (1 2 1)/4 in both directions, in `out`,
/// whose memory is used again; mirrored at the borders.
///
/// The two filters multiply to ³⁄₂ (1 + cos ω)/(2 + cos ω), whose impulse response
/// ³⁄₂ (δₖ − z^|k|/√3), z = √3 − 2, falls off so fast that it is cheaper summed than run as a recursion.
pub(super) fn smoothed_coefficients(image: &Image, out: &mut Image) {
    let (width, height) = image.size();
    let mut taps = [0.0_f32; TAPS + 1];
    let mut power = -1.5 / 3.0_f32.sqrt();
    for tap in &mut taps {
        *tap = power;
        power *= POLE;
    }
    taps[0] += 1.5;
    // What was cut off goes to the middle: a constant image stays what it is.
    taps[0] += 1.0 - taps[0] - 2.0 * taps[1..].iter().sum::<f32>();
    fill_rows(
        out,
        (width, height),
        || vec![0.0_f32; width + 2 * TAPS],
        |line, v, out| {
            let row = |k: usize| image.row(reflected(v as isize + k as isize - TAPS as isize, height));
            let rows: [&[f32]; 2 * TAPS + 1] = std::array::from_fn(row);
            filter_row(&rows, &taps, line, out);
        },
    );
}

vectorised! {
/// Down the columns, then along the row.
filter_row(rows: &[&[f32]; 2 * TAPS + 1], taps: &[f32; TAPS + 1], line: &mut [f32], out: &mut [f32]) {
    let width = out.len();
    weighted_sum(rows, taps, &mut line[TAPS..TAPS + width]);
    for k in 1..=TAPS {
        line[TAPS - k] = line[TAPS + reflected(-(k as isize), width)];
        line[TAPS + width - 1 + k] = line[TAPS + reflected((width - 1 + k) as isize, width)];
    }
    let shifted: [&[f32]; 2 * TAPS + 1] = std::array::from_fn(|k| &line[k..k + width]);
    weighted_sum(&shifted, taps, out);
}
}

/// Σ of lines with symmetric weights, the middle one's first.
#[inline(always)]
fn weighted_sum(lines: &[&[f32]; 2 * TAPS + 1], taps: &[f32; TAPS + 1], out: &mut [f32]) {
    const LANES: usize = 16;
    let whole = out.len() / LANES * LANES;
    let (blocks, rest) = out.as_chunks_mut::<LANES>();
    for (k, block) in blocks.iter_mut().enumerate() {
        *block = weighted_block(lines, taps, k * LANES);
    }
    for (k, out) in rest.iter_mut().enumerate() {
        [*out] = weighted_block(lines, taps, whole + k);
    }
}

/// The same of N neighbouring values from `first` on.
#[inline(always)]
fn weighted_block<const N: usize>(
    lines: &[&[f32]; 2 * TAPS + 1],
    taps: &[f32; TAPS + 1],
    first: usize,
) -> [f32; N] {
    let mut sum = [0.0; N];
    let middle = &lines[TAPS][first..first + N];
    for i in 0..N {
        sum[i] = taps[0] * middle[i];
    }
    for k in 1..=TAPS {
        let (before, after) = (&lines[TAPS - k][first..first + N], &lines[TAPS + k][first..first + N]);
        for i in 0..N {
            sum[i] += taps[k] * (before[i] + after[i]);
        }
    }
    sum
}

/// An index beyond a line of `n`, mirrored about its first and last pixel as often as needed.
fn reflected(index: isize, n: usize) -> usize {
    let period = (2 * n).saturating_sub(2).max(1);
    let index = index.rem_euclid(period as isize) as usize;
    index.min(period - index).min(n - 1)
}

/// The inverse filter along one line.
fn filter(line: &mut [f32]) {
    filter_rows(line, 1);
}

/// The inverse filter down the columns of rows of `width` values.
fn filter_rows(values: &mut [f32], width: usize) {
    let height = values.len() / width.max(1);
    if height < 2 {
        return;
    }
    // Causal start: the mirrored signal's sum, cut where it no longer counts.
    let mut start = values[..width].to_vec();
    let mut power = POLE;
    for v in 1..height.min(REACH) {
        for (s, &x) in start.iter_mut().zip(&values[v * width..]) {
            *s += power * x;
        }
        power *= POLE;
    }
    values[..width].copy_from_slice(&start);
    for v in 1..height {
        let (before, here) = values.split_at_mut(v * width);
        for (x, &b) in here[..width].iter_mut().zip(&before[(v - 1) * width..]) {
            *x += POLE * b;
        }
    }
    // Anticausal start for a mirrored signal.
    let last = (height - 1) * width;
    let end = POLE / (POLE * POLE - 1.0);
    for i in 0..width {
        values[last + i] = end * (values[last + i] + POLE * values[last - width + i]);
    }
    for v in (0..height - 1).rev() {
        let (here, after) = values.split_at_mut((v + 1) * width);
        for (x, &a) in here[v * width..].iter_mut().zip(&after[..width]) {
            *x = POLE * (a - *x);
        }
    }
    values.iter_mut().for_each(|x| *x *= 6.0);
}

/// Value at (u, v) in pixels from coefficients in both directions, mirrored at the border; `None` outside.
#[inline]
pub(super) fn sample(coefficients: &Grid<f32>, u: f32, v: f32) -> Option<f32> {
    let (width, height) = coefficients.size();
    if !(u >= 0.0 && v >= 0.0 && u <= width as f32 - 1.0 && v <= height as f32 - 1.0) {
        return None;
    }
    let (u0, v0) = (u as usize, v as usize);
    let (wu, wv) = (weights(u - u0 as f32), weights(v - v0 as f32));
    let mut sum = 0.0;
    if u0 >= 1 && v0 >= 1 && u0 + 3 <= width && v0 + 3 <= height {
        for (k, w) in wv.into_iter().enumerate() {
            let four = coefficients.row(v0 + k - 1).get(u0 - 1..)?.first_chunk::<4>()?;
            sum += w * (four[0] * wu[0] + four[1] * wu[1] + four[2] * wu[2] + four[3] * wu[3]);
        }
        return Some(sum);
    }
    for (k, w) in wv.into_iter().enumerate() {
        let row = coefficients.row(mirrored(v0 + k, height));
        for (l, x) in wu.into_iter().enumerate() {
            sum += w * x * row[mirrored(u0 + l, width)];
        }
    }
    Some(sum)
}

/// Index `shifted − 1` of a line of `n`, mirrored about its first and last pixel.
fn mirrored(shifted: usize, n: usize) -> usize {
    let index = if shifted == 0 { 1 } else { shifted - 1 };
    (if index >= n { (2 * n).saturating_sub(2 + index) } else { index }).min(n - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spline_passes_through_the_pixels() {
        let image = Grid::from_fn(33, 21, |u, v| ((u * 37 + v * 91) % 50) as f32);
        let c = coefficients(&image);
        for (u, v) in [(0, 0), (32, 20), (1, 19), (16, 10), (31, 3)] {
            let value = sample(&c, u as f32, v as f32).unwrap();
            assert!((value - image.at(u, v)).abs() < 1e-3, "{u} {v}: {value} {}", image.at(u, v));
        }
        assert_eq!(sample(&c, 32.01, 3.0), None);
        assert_eq!(sample(&c, f32::NAN, 3.0), None);
    }

    #[test]
    fn fine_texture_keeps_its_contrast_between_pixels() {
        // Four pixels a period: Keys' cubic leaves .884 of the contrast, the spline .972.
        let wave = |u: f64| (u * std::f64::consts::FRAC_PI_2).cos();
        let image = Grid::from_fn(64, 8, |u, _| wave(u as f64) as f32);
        let c = coefficients(&image);
        for u in [20.5, 21.5, 30.25] {
            let error = f64::from(sample(&c, u as f32, 4.0).unwrap()) - wave(u);
            assert!(error.abs() < 0.025, "{u}: {error}");
        }
    }

    #[test]
    fn smoothing_and_inverting_at_once_is_the_same_as_one_after_the_other() {
        use crate::observe::pyramid::smooth;
        let image = Grid::from_fn(70, 50, |u, v| ((u * 37 + v * 91 + u * u * v) % 250) as f32);
        let expected = coefficients(&smooth(&image));
        let mut both = Grid::filled(0, 0, 0.0);
        smoothed_coefficients(&image, &mut both);
        for v in 8..42 {
            for u in 8..62 {
                let error = (both.at(u, v) - expected.at(u, v)).abs();
                assert!(error < 0.05, "{u} {v}: {} {}", both.at(u, v), expected.at(u, v));
            }
        }
        smoothed_coefficients(&Grid::filled(9, 7, 50.0), &mut both);
        assert!(both.values().iter().all(|c| (c - 50.0).abs() < 1e-3));
    }

    #[test]
    fn the_smallest_images_are_no_trouble() {
        for (width, height) in [(0, 0), (1, 1), (2, 1), (1, 5), (3, 2)] {
            let c = coefficients(&Grid::filled(width, height, 7.0));
            let mut smoothed = Grid::filled(0, 0, 0.0);
            smoothed_coefficients(&Grid::filled(width, height, 7.0), &mut smoothed);
            assert!(smoothed.size() == (width, height) && smoothed.values().iter().all(|c| c.is_finite()));
            if width > 0 {
                let centre = sample(&c, (width - 1) as f32 / 2.0, (height - 1) as f32 / 2.0).unwrap();
                assert!(centre.is_finite());
            }
        }
    }
}
