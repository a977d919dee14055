//! Image pyramid and image gradients, computed once per frame and shared by flow and tracks.

use crate::geometry::{Grid, Image};
use crate::simd::vectorised;
use rayon::prelude::*;

/// Least side of a level, in pixels: a smaller one holds no patch of the flow's search.
const MIN_SIDE: usize = 8;
/// Rows handled by one task; fixed, and large enough to be worth one.
const STRIP_ROWS: usize = 32;
/// Variance of one component of [`gradients`] caused by white noise of variance 1 in the image:
/// Σ of the squared weights of ½(−1 0 1) × (3 10 3)/16.
pub(super) const GRADIENT_NOISE_GAIN: f32 = 0.5 * (9.0 + 100.0 + 9.0) / 256.0;

/// An image and its successively halved versions.
///
/// Pixel (u, v) of level l lies at (2ˡ u, 2ˡ v) of the image itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Pyramid {
    levels: Vec<Image>,
}

impl Pyramid {
    /// The pyramid of `image`: up to `max_levels` levels (at least the image itself), none of them but
    /// the first with a side under 8 pixels.
    ///
    /// Each level is the one before, smoothed by the 5-tap binomial (1 4 6 4 1)/16 in both directions
    /// (border pixels repeated) and decimated by 2.
    pub fn new(image: Image, max_levels: usize) -> Self {
        let mut pyramid = Self { levels: vec![image] };
        pyramid.build(max_levels);
        pyramid
    }

    /// The pyramid of [`smooth`]ed `image` in place of this one, whose memory is used again.
    pub fn renew(&mut self, image: &Image, max_levels: usize) {
        if self.levels.is_empty() {
            self.levels.push(Grid::filled(0, 0, 0.0));
        }
        smooth_into(image, &mut self.levels[0]);
        self.build(max_levels);
    }

    /// All levels above the first.
    fn build(&mut self, max_levels: usize) {
        let (mut width, mut height) = self.size();
        let mut count = 1;
        while count < max_levels {
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            if width.min(height) < MIN_SIDE {
                break;
            }
            if self.levels.len() == count {
                self.levels.push(Grid::filled(0, 0, 0.0));
            }
            let (finer, coarser) = self.levels.split_at_mut(count);
            halve_into(&finer[count - 1], &mut coarser[0]);
            count += 1;
        }
        self.levels.truncate(count);
    }

    /// All levels, the image itself first.
    pub fn levels(&self) -> &[Image] {
        &self.levels
    }

    /// (width, height) of the image itself, in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.levels.first().map_or((0, 0), Image::size)
    }
}

/// Compute every row of `out`, which gets the given size, from its index; `scratch` makes a buffer per task.
pub(super) fn fill_rows<S>(
    out: &mut Image,
    (width, height): (usize, usize),
    scratch: impl Fn() -> S + Sync,
    row: impl Fn(&mut S, usize, &mut [f32]) + Sync,
) {
    if out.size() != (width, height) {
        *out = Grid::filled(width, height, 0.0);
    }
    out.values_mut().par_chunks_mut(width.max(1) * STRIP_ROWS).enumerate().for_each(|(strip, rows)| {
        let mut scratch = scratch();
        for (k, out) in rows.chunks_exact_mut(width.max(1)).enumerate() {
            row(&mut scratch, strip * STRIP_ROWS + k, out);
        }
    });
}

/// The image smoothed by the binomial (1 2 1)/4 in both directions, border pixels repeated.
///
/// Sub-pixel interpolation is only as good as the image is smooth: without this a displacement of a
/// fraction of a pixel comes out several per cent too large or too small on fine texture.
pub fn smooth(image: &Image) -> Image {
    let mut out = Grid::filled(0, 0, 0.0);
    smooth_into(image, &mut out);
    out
}

fn smooth_into(image: &Image, out: &mut Image) {
    let (width, height) = image.size();
    fill_rows(
        out,
        (width, height),
        || vec![0.0_f32; width + 2],
        |line, y, out| {
            let rows = [image.row(y.saturating_sub(1)), image.row(y), image.row((y + 1).min(height - 1))];
            smooth_row(rows, line, out);
        },
    );
}

vectorised! {
smooth_row(rows: [&[f32]; 3], line: &mut [f32], out: &mut [f32]) {
    let [above, here, below] = rows;
    let width = out.len();
    for (((s, &a), &h), &b) in line[1..=width].iter_mut().zip(above).zip(here).zip(below) {
        *s = 0.25 * (a + b) + 0.5 * h;
    }
    (line[0], line[width + 1]) = (line[1], line[width]);
    let (left, right) = (&line[..width], &line[2..width + 2]);
    for (((o, &l), &c), &r) in out.iter_mut().zip(left).zip(&line[1..=width]).zip(right) {
        *o = 0.25 * (l + r) + 0.5 * c;
    }
}
}

/// Smooth by the binomial (1 4 6 4 1)/16 and keep every second pixel.
fn halve_into(image: &Image, half: &mut Image) {
    let (width, height) = image.size();
    fill_rows(
        half,
        (width.div_ceil(2), height.div_ceil(2)),
        || vec![0.0_f32; width + 5],
        |line, y, out| {
            let row = |dy: usize| image.row((2 * y + dy).saturating_sub(2).min(height - 1));
            let rows = [row(0), row(1), row(2), row(3), row(4)];
            halve_row(rows, line, out);
        },
    );
}

vectorised! {
halve_row(rows: [&[f32]; 5], line: &mut [f32], out: &mut [f32]) {
    let width = rows[0].len();
    let rows = rows.map(|row| &row[..width]);
    for (x, s) in line[2..width + 2].iter_mut().enumerate() {
        *s = (rows[0][x] + rows[4][x] + 4.0 * (rows[1][x] + rows[3][x]) + 6.0 * rows[2][x]) / 16.0;
    }
    let (first, last) = (line[2], line[width + 1]);
    line[..2].fill(first);
    line[width + 2..].fill(last);
    // Pairs of even and odd pixels, so that whole vectors are read.
    let (pairs, _) = line.as_chunks::<2>();
    let n = out.len();
    let (a, b, c) = (&pairs[..n], &pairs[1..n + 1], &pairs[2..n + 2]);
    for (((o, a), b), c) in out.iter_mut().zip(a).zip(b).zip(c) {
        *o = (a[0] + c[0] + 4.0 * (a[1] + b[1]) + 6.0 * b[0]) / 16.0;
    }
}
}

/// Derivatives of an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gradients {
    /// ∂I/∂u, in grey levels per pixel.
    pub du: Grid<f32>,
    /// ∂I/∂v, in grey levels per pixel.
    pub dv: Grid<f32>,
}

/// Scharr's 3×3 derivatives, ½(−1 0 1) along and (3 10 3)/16 across; border pixels repeated.
pub(super) fn gradients(image: &Image) -> Gradients {
    let (width, height) = image.size();
    let mut du = Grid::filled(width, height, 0.0_f32);
    let mut dv = du.clone();
    let rows = du.values_mut().par_chunks_mut(width.max(1)).zip(dv.values_mut().par_chunks_mut(width.max(1)));
    rows.enumerate().for_each_init(
        || (vec![0.0_f32; width + 2], vec![0.0_f32; width + 2]),
        |(smooth, slope), (y, (du, dv))| {
            let (above, here, below) =
                (image.row(y.saturating_sub(1)), image.row(y), image.row((y + 1).min(height - 1)));
            for (x, (s, d)) in smooth[1..=width].iter_mut().zip(&mut slope[1..=width]).enumerate() {
                *s = (3.0 * (above[x] + below[x]) + 10.0 * here[x]) / 16.0;
                *d = 0.5 * (below[x] - above[x]);
            }
            for padded in [&mut *smooth, &mut *slope] {
                padded[0] = padded[1];
                padded[width + 1] = padded[width];
            }
            for x in 0..width {
                du[x] = 0.5 * (smooth[x + 2] - smooth[x]);
                dv[x] = (3.0 * (slope[x] + slope[x + 2]) + 10.0 * slope[x + 1]) / 16.0;
            }
        },
    );
    Gradients { du, dv }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_keeps_a_plane_and_its_place() {
        let image = Grid::from_fn(41, 30, |u, v| 3.0 * u as f32 - 2.0 * v as f32);
        let pyramid = Pyramid::new(image, 9);
        assert_eq!(
            pyramid.levels().iter().map(Image::size).collect::<Vec<_>>(),
            [(41, 30), (21, 15), (11, 8)]
        );
        let half = &pyramid.levels()[1];
        assert_eq!(half.at(7, 5), 3.0 * 14.0 - 2.0 * 10.0);
    }

    #[test]
    fn gradients_of_a_plane_are_its_slopes() {
        let g = gradients(&Grid::from_fn(9, 7, |u, v| 3.0 * u as f32 - 2.0 * v as f32));
        assert_eq!((g.du.at(4, 3), g.dv.at(4, 3)), (3.0, -2.0));
        assert_eq!((g.du.at(0, 3), g.dv.at(4, 6)), (1.5, -1.0));
    }

    #[test]
    fn the_smallest_images_are_no_trouble() {
        for (width, height) in [(0, 0), (1, 1), (1, 5), (2, 1)] {
            let image = Grid::filled(width, height, 7.0);
            assert_eq!(Pyramid::new(image.clone(), 4).levels().len(), 1);
            assert!(gradients(&image).du.values().iter().all(|&g| g == 0.0));
        }
    }
}
