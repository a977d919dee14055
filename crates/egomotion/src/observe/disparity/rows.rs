//! By how much matching rows of the two images disagree, over the image.
//!
//! No rectification is perfect: a quarter of a pixel up or down is common on recordings. Where an
//! edge is slanted it looks like disparity, so the refinement takes it out.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::lanes::{Bytes, Kernel, widest};
use crate::geometry::Image;

/// A difference of grey levels that more than so many rows would explain is no disagreement of rows.
const LARGEST_PX: f32 = 2.0;
/// By how much an edge must be steeper down the image than along the row to tell of rows.
const STEEPER: f32 = 2.0;
/// Largest disagreement that is believed, in pixels: beyond it matching does not work anyway.
const LARGEST_FIT_PX: f64 = 1.5;
/// Fewest pixels that fix the three numbers.
const FEWEST_PIXELS: f64 = 1000.0;

/// Right row minus left row of a match, an affine function of the left pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct RowOffset {
    /// At the first pixel, in pixels.
    pub offset: f32,
    /// Growth along a row and down the image, px per px.
    pub per_u: f32,
    pub per_v: f32,
}

impl RowOffset {
    /// Weighted least squares of e = h Δ over the pixels whose grey level changes mainly down the
    /// image: e is left minus right grey level, h the left image's slope down, g that along the row.
    ///
    /// `rows` are e and g of each row, 0 where unknown. None where the image tells nothing.
    pub fn fit<'a>(left: &Image, rows: impl IndexedParallelIterator<Item = (&'a [f32], &'a [f32])>) -> Self {
        let sums = |(v, (difference, slope)): (usize, (&[f32], &[f32]))| {
            let (above, below) = beside(left, v);
            let sums = widest(Sum { difference, slope, above, below }).map(f64::from);
            let [n, hh, hhu, hhuu, he, heu] = sums;
            let v = v as f64;
            let normal = Matrix3::new(hh, hhu, hh * v, hhu, hhuu, hhu * v, hh * v, hhu * v, hh * v * v);
            (n, normal, Vector3::new(he, heu, he * v))
        };
        // Added row by row: the answer does not depend on the threads.
        let sums: Vec<_> = rows.enumerate().map(sums).collect();
        let zero = (0.0, Matrix3::zeros(), Vector3::zeros());
        let (n, normal, right) = sums.into_iter().fold(zero, |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
        let found = normal.cholesky().map(|c| c.solve(&right)).filter(|_| n >= FEWEST_PIXELS);
        let corner = |f: &Vector3<f64>, u: usize, v: usize| (f.x + f.y * u as f64 + f.z * v as f64).abs();
        let (right_end, bottom) = (left.width(), left.height());
        let believed = found.filter(|f| {
            [(0, 0), (right_end, 0), (0, bottom), (right_end, bottom)]
                .into_iter()
                .all(|(u, v)| corner(f, u, v) <= LARGEST_FIT_PX)
        });
        believed.map_or_else(Self::default, |f| Self {
            offset: f.x as f32,
            per_u: f.y as f32,
            per_v: f.z as f32,
        })
    }

    /// At the first pixel of row `v`, and the growth along it.
    pub fn along(&self, v: usize) -> (f32, f32) {
        (self.offset + self.per_v * v as f32, self.per_u)
    }
}

/// The rows above and below row `v`; at the border twice the border.
pub(super) fn beside(image: &Image, v: usize) -> (&[f32], &[f32]) {
    (image.row(v.saturating_sub(1)), image.row((v + 1).min(image.height() - 1)))
}

/// Over a row: number of pixels, and the sums of h², h²u, h²u², h e, h e u.
struct Sum<'a> {
    difference: &'a [f32],
    slope: &'a [f32],
    above: &'a [f32],
    below: &'a [f32],
}

/// Sums side by side, so that they vectorise; their order is fixed.
const WIDE: usize = 8;

impl Kernel for Sum<'_> {
    type Output = [f32; 6];
    #[inline(always)]
    fn run<B: Bytes>(self) -> [f32; 6] {
        let mut sums = [[0.0_f32; WIDE]; 6];
        let lines = (self.difference.as_chunks::<WIDE>().0.iter()).zip(self.slope.as_chunks::<WIDE>().0);
        let beside = (self.above.as_chunks::<WIDE>().0.iter()).zip(self.below.as_chunks::<WIDE>().0);
        for (part, ((e, g), (above, below))) in lines.zip(beside).enumerate() {
            for i in 0..WIDE {
                let h = 0.5 * (below[i] - above[i]);
                let tells =
                    h.abs() > STEEPER * g[i].abs() && e[i].abs() <= LARGEST_PX * h.abs() && e[i] != 0.0;
                let (h, e) = if tells { (h, e[i]) } else { (0.0, 0.0) };
                let u = (part * WIDE + i) as f32;
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
