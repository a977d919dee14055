//! A row of the left image compared with the right one, each pixel at its disparity, and by how much matching
//! rows of the two images disagree.
//!
//! No rectification is perfect: a quarter of a pixel up or down is common on recordings. Where an
//! edge is slanted it looks like disparity, so the refinement takes it out.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::geometry::Image;
use crate::observe::spline;
use crate::simd::{Bytes, Kernel, widest};

/// Pixels compared at a time: what they need fits into the registers and the fastest cache.
const TILE: usize = 64;
/// A difference of grey levels tells of rows only where so many pixels of disagreement would explain it: beyond it
/// the pixel is mismatched.
const LARGEST_EVIDENCE_PX: f32 = 2.0;
/// An edge tells of rows only where it is steeper down the image than along the row by this factor: a smaller one
/// lets errors of disparity in.
const LEAST_STEEPNESS: f32 = 2.0;
/// Largest disagreement that is believed, in pixels: beyond it matching does not work anyway.
const LARGEST_OFFSET_PX: f64 = 1.5;
/// Fewest pixels that fix the three numbers of a disagreement; with fewer it counts as zero.
const FEWEST_FIT_PIXELS: f64 = 1000.0;
/// Sums side by side, so that they vectorise; a fixed number, since it decides the order of the additions.
const SUM_LANES: usize = 8;

/// A row of the left image against the right one, each pixel at its disparity.
pub(super) struct CompareRow<'a> {
    pub left: &'a [f32],
    /// The left image's rows above and below.
    pub above: &'a [f32],
    pub below: &'a [f32],
    /// Right row minus left row at the first pixel, and its growth from pixel to pixel.
    pub row_offset: (f32, f32),
    /// Spline coefficients.
    pub right: &'a [f32],
    pub disparity: &'a [f32],
    pub weight: &'a mut [f32],
    pub slope: &'a mut [f32],
    pub difference: &'a mut [f32],
}

impl Kernel for CompareRow<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let Self { left, above, below, row_offset, right, disparity, weight, slope, difference } = self;
        let width = left.len();
        if width < 4 {
            [weight, slope, difference].into_iter().for_each(|line| line.fill(0.0));
            return;
        }
        for first in (0..width).step_by(TILE) {
            let here = first..(first + TILE).min(width);
            let mut tile = Tile::new(first, left, &disparity[here.clone()]);
            tile.split(width);
            for (i, &from) in tile.from.iter().enumerate() {
                let Some(taps) = right.get(from as usize..from as usize + 4) else { continue };
                for (line, &tap) in tile.taps.iter_mut().zip(taps) {
                    line[i] = tap;
                }
            }
            let mut lines = tile.compare(width);
            let mut down = [0.0; TILE];
            for (down, (above, below)) in
                down.iter_mut().zip(above[here.clone()].iter().zip(&below[here.clone()]))
            {
                *down = 0.5 * (below - above);
            }
            // What is seen of another row: it has no part in disparity.
            let [weight_here, _, difference_here] = &mut lines;
            for i in 0..TILE {
                let rows = row_offset.0 + row_offset.1 * (first + i) as f32;
                difference_here[i] -= weight_here[i] * rows * down[i];
            }
            let outputs = [&mut weight[here.clone()], &mut slope[here.clone()], &mut difference[here]];
            for (output, line) in outputs.into_iter().zip(&lines) {
                output.copy_from_slice(&line[..output.len()]);
            }
        }
        // The first and the last pixel have no slope.
        for u in [0, width - 1] {
            (weight[u], slope[u], difference[u]) = (0.0, 0.0, 0.0);
        }
    }
}

/// Some pixels of the left row, and what the right row has for them.
struct Tile {
    /// Grey levels from one pixel before the first to one after the last.
    left: [f32; TILE + 2],
    /// Where in the right row each pixel is looked for.
    at: [f32; TILE],
    /// The first of the four coefficients around, and how far `at` is beyond the second.
    from: [u32; TILE],
    fraction: [f32; TILE],
    taps: [[f32; TILE]; 4],
}

impl Tile {
    #[inline(always)]
    fn new(first: usize, left: &[f32], disparity: &[f32]) -> Self {
        let mut tile = Self {
            left: [0.0; TILE + 2],
            at: [f32::NAN; TILE],
            from: [0; TILE],
            fraction: [0.0; TILE],
            taps: [[0.0; TILE]; 4],
        };
        let start = first.saturating_sub(1);
        let grey = &left[start..(first + TILE + 1).min(left.len())];
        let offset = start + 1 - first;
        tile.left[offset..offset + grey.len()].copy_from_slice(grey);
        for (i, (at, d)) in tile.at.iter_mut().zip(disparity).enumerate() {
            *at = (first + i) as f32 - d;
        }
        tile
    }

    /// Whole pixel and fraction of each place inside; anything elsewhere.
    #[inline(always)]
    fn split(&mut self, width: usize) {
        // Added to less than 2²³ this leaves the whole number in the last bits: a few operations on
        // vectors, where a checked conversion takes many.
        const LAST_BIT_IS_ONE: f32 = 8_388_608.0;
        let last = width as f32 - 3.0;
        for i in 0..TILE {
            let at = self.at[i];
            let inside = if at >= 1.0 { at } else { 1.0 };
            let inside = if inside <= last { inside } else { last };
            let whole = inside - 0.5 + LAST_BIT_IS_ONE;
            self.from[i] = (whole.to_bits() & 0x7f_ffff).saturating_sub(1);
            self.fraction[i] = inside - (whole - LAST_BIT_IS_ONE);
        }
    }

    /// Weight, slope and difference of each pixel.
    #[inline(always)]
    fn compare(&self, width: usize) -> [[f32; TILE]; 3] {
        let mut lines = [[0.0; TILE]; 3];
        let [weight, slope, difference] = &mut lines;
        let [a, b, c, d] = &self.taps;
        let end = width as f32 - 2.0;
        for i in 0..TILE {
            let at = self.at[i];
            // Of NaN this is false.
            let inside = at >= 1.0 && at < end;
            let w = spline::weights(self.fraction[i]);
            let grey = w[0] * a[i] + w[1] * b[i] + w[2] * c[i] + w[3] * d[i];
            weight[i] = if inside { 1.0 } else { 0.0 };
            // The right image's own slope would carry the noise of the grey level read there, and
            // pull every answer towards half pixels.
            slope[i] = if inside { 0.5 * (self.left[i + 2] - self.left[i]) } else { 0.0 };
            difference[i] = if inside { self.left[i + 1] - grey } else { 0.0 };
        }
        lines
    }
}

/// Right row minus left row of a match, an affine function of the left pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct RowOffset {
    /// At the first pixel, in pixels.
    offset: f32,
    /// Growth along a row and down the image, px per px.
    per_u: f32,
    per_v: f32,
}

impl RowOffset {
    /// Weighted least squares of e = h Δ over the pixels whose grey level changes mainly down the
    /// image: e is left minus right grey level, h the left image's slope down, g that along the row.
    ///
    /// `rows` are e and g of each row, 0 where unknown. None where the image tells nothing.
    pub(super) fn fit<'a>(
        left: &Image,
        rows: impl IndexedParallelIterator<Item = (&'a [f32], &'a [f32])>,
    ) -> Self {
        let sums = |(v, (difference, slope)): (usize, (&[f32], &[f32]))| {
            let (above, below) = rows_beside(left, v);
            let sums = widest(RowOffsetSums { difference, slope, above, below }).map(f64::from);
            let [n, hh, hhu, hhuu, he, heu] = sums;
            let v = v as f64;
            let normal = Matrix3::new(hh, hhu, hh * v, hhu, hhuu, hhu * v, hh * v, hhu * v, hh * v * v);
            (n, normal, Vector3::new(he, heu, he * v))
        };
        // Added row by row: the answer does not depend on the threads.
        let sums: Vec<_> = rows.enumerate().map(sums).collect();
        let zero = (0.0, Matrix3::zeros(), Vector3::zeros());
        let (n, normal, right) = sums.into_iter().fold(zero, |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
        let found = normal.cholesky().map(|c| c.solve(&right)).filter(|_| n >= FEWEST_FIT_PIXELS);
        let corner = |f: &Vector3<f64>, u: usize, v: usize| (f.x + f.y * u as f64 + f.z * v as f64).abs();
        let (right_end, bottom) = (left.width(), left.height());
        let believed = found.filter(|f| {
            [(0, 0), (right_end, 0), (0, bottom), (right_end, bottom)]
                .into_iter()
                .all(|(u, v)| corner(f, u, v) <= LARGEST_OFFSET_PX)
        });
        believed.map_or_else(Self::default, |f| Self {
            offset: f.x as f32,
            per_u: f.y as f32,
            per_v: f.z as f32,
        })
    }

    /// At the first pixel of row `v`, and the growth along it.
    pub(super) fn along(&self, v: usize) -> (f32, f32) {
        (self.offset + self.per_v * v as f32, self.per_u)
    }
}

/// The rows above and below row `v`; at the border twice the border.
pub(super) fn rows_beside(image: &Image, v: usize) -> (&[f32], &[f32]) {
    (image.row(v.saturating_sub(1)), image.row((v + 1).min(image.height() - 1)))
}

/// Over a row: number of pixels, and the sums of h², h²u, h²u², h e, h e u.
struct RowOffsetSums<'a> {
    difference: &'a [f32],
    slope: &'a [f32],
    above: &'a [f32],
    below: &'a [f32],
}

impl Kernel for RowOffsetSums<'_> {
    type Output = [f32; 6];
    #[inline(always)]
    fn run<B: Bytes>(self) -> [f32; 6] {
        let mut sums = [[0.0_f32; SUM_LANES]; 6];
        let lines =
            (self.difference.as_chunks::<SUM_LANES>().0.iter()).zip(self.slope.as_chunks::<SUM_LANES>().0);
        let beside =
            (self.above.as_chunks::<SUM_LANES>().0.iter()).zip(self.below.as_chunks::<SUM_LANES>().0);
        for (part, ((e, g), (above, below))) in lines.zip(beside).enumerate() {
            for i in 0..SUM_LANES {
                let h = 0.5 * (below[i] - above[i]);
                let tells = h.abs() > LEAST_STEEPNESS * g[i].abs()
                    && e[i].abs() <= LARGEST_EVIDENCE_PX * h.abs()
                    && e[i] != 0.0;
                let (h, e) = if tells { (h, e[i]) } else { (0.0, 0.0) };
                let u = (part * SUM_LANES + i) as f32;
                let terms =
                    [if tells { 1.0 } else { 0.0 }, h * h, h * h * u, h * h * u * u, h * e, h * e * u];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    sum[i] += term;
                }
            }
        }
        sums.map(|lanes| lanes.iter().sum())
    }
}
