//! Images smoothed and in 16 bits, whatever their depth: what the matchers begin with.

use rayon::prelude::*;

use crate::geometry::Image;
use crate::simd::{Bytes, Kernel, LANES, widest};

/// An image smoothed by the binomial (1, 2, 1)/4 both ways, in rows continued at either end.
#[derive(Debug, Clone, Default)]
pub(super) struct Smoothed {
    values: Vec<i16>,
    stride: usize,
    column: Vec<f32>,
}

impl Smoothed {
    /// Smooth `image` times `scale`; its last column first if `mirrored`.
    ///
    /// Rows begin `margin` pixels before the image and end as many or more after a multiple of
    /// `LANES`; there the nearest pixel stands.
    pub(super) fn compute(&mut self, image: &Image, margin: usize, scale: f32, mirrored: bool) {
        let (width, height) = image.size();
        self.stride = width.next_multiple_of(LANES) + 2 * margin;
        self.values.resize(self.stride * height, 0);
        self.column.resize(width * height, 0.0);
        if self.column.is_empty() {
            return;
        }
        let rows = self.values.par_chunks_mut(self.stride).zip(self.column.par_chunks_mut(width));
        rows.enumerate().for_each(|(v, (row, column))| {
            widest(Smooth { image, v, row, margin, scale, mirrored, column });
        });
    }

    /// Row `v`, from `margin` pixels before the image on.
    pub(super) fn row(&self, v: usize) -> &[i16] {
        &self.values[v * self.stride..(v + 1) * self.stride]
    }
}

/// The factor that spreads the grey levels of a pair over 15 bits: a power of two, so that whole
/// grey levels stay exact.
pub(super) fn grey_scale(images: [&Image; 2]) -> f32 {
    let largest = |image: &Image| {
        image.values().par_chunks(1 << 14).map(|part| widest(Largest(part))).reduce(|| 0.0, f32::max)
    };
    let largest = largest(images[0]).max(largest(images[1]));
    if largest > 0.0 { (32_767.0 / largest).log2().floor().clamp(-100.0, 100.0).exp2() } else { 1.0 }
}

struct Largest<'a>(&'a [f32]);

impl Kernel for Largest<'_> {
    type Output = f32;
    #[inline(always)]
    fn run<B: Bytes>(self) -> f32 {
        let mut most = [0.0_f32; LANES];
        let (parts, rest) = self.0.as_chunks::<LANES>();
        let size = |x: f32| if x.abs() < f32::INFINITY { x.abs() } else { 0.0 };
        for part in parts {
            for (most, &x) in most.iter_mut().zip(part) {
                let x = size(x);
                *most = if x > *most { x } else { *most };
            }
        }
        most.iter().copied().chain(rest.iter().map(|&x| size(x))).fold(0.0, f32::max)
    }
}

/// Row `v` smoothed, continued by `margin` and more copies of its ends.
struct Smooth<'a> {
    image: &'a Image,
    v: usize,
    row: &'a mut [i16],
    margin: usize,
    scale: f32,
    mirrored: bool,
    column: &'a mut [f32],
}

impl Kernel for Smooth<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let Self { image, v, row, margin, scale, mirrored, column } = self;
        let (width, height) = image.size();
        let (above, here) = (image.row(v.saturating_sub(1)), image.row(v));
        let below = image.row((v + 1).min(height - 1));
        let scale = scale / 16.0;
        for (((column, a), h), b) in column.iter_mut().zip(above).zip(here).zip(below) {
            *column = (a + 2.0 * h + b) * scale;
        }
        let inner = &mut row[margin..margin + width];
        for (smooth, three) in inner[1.min(width)..].iter_mut().zip(column.windows(3)) {
            *smooth = whole(three[0] + 2.0 * three[1] + three[2]);
        }
        let last = width - 1;
        inner[0] = whole(3.0 * column[0] + column[1.min(last)]);
        inner[last] = whole(3.0 * column[last] + column[last.saturating_sub(1)]);
        if mirrored {
            inner.reverse();
        }
        let (first, last) = (inner[0], inner[last]);
        row[..margin].fill(first);
        row[margin + width..].fill(last);
    }
}

/// The nearest whole number of what 16 bits hold; anything of anything else.
///
/// After this addition the last bits of the number are those of the whole number: a few operations
/// on vectors, where a checked conversion takes many.
#[inline(always)]
fn whole(x: f32) -> i16 {
    const LAST_BIT_IS_ONE: f32 = 12_582_912.0;
    (x + LAST_BIT_IS_ONE).to_bits() as i16
}
