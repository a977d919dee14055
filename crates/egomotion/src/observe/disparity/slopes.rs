//! The horizontal slope of an image in bytes: what area correlation compares.

use rayon::prelude::*;

use super::lanes::{Bytes, Kernel, widest};
use super::smoothing::Smoothed;
use crate::geometry::Image;

/// The byte of no slope.
pub(super) const ZERO: u8 = 63;
/// Largest slope told apart, either way.
const LARGEST: i32 = 63;
/// Bits by which the difference of two neighbours is shifted: slopes of an 8-bit image count in
/// quarters of a grey level per pixel.
const SHIFT: u32 = 6;

/// Slopes, row by row.
#[derive(Debug, Clone, Default)]
pub(super) struct Slopes {
    smoothed: Smoothed,
    bytes: Vec<u8>,
    width: usize,
}

impl Slopes {
    /// The slopes of `image` smoothed by (1, 2, 1)/4 both ways, of the last column first if `mirrored`.
    pub fn compute(&mut self, image: &Image, scale: f32, mirrored: bool) {
        self.width = image.width();
        self.smoothed.compute(image, 1, scale, mirrored);
        self.bytes.resize(image.values().len(), 0);
        let Self { smoothed, bytes, width } = self;
        // In the mirrored image the slope has the other sign.
        let sign = if mirrored { -1 } else { 1 };
        bytes.par_chunks_mut((*width).max(1)).enumerate().for_each(|(v, bytes)| {
            widest(Row { smoothed: smoothed.row(v), bytes, sign });
        });
    }

    /// Row `v`.
    pub fn row(&self, v: usize) -> &[u8] {
        &self.bytes[v * self.width..(v + 1) * self.width]
    }
}

struct Row<'a> {
    /// From one pixel before the first on.
    smoothed: &'a [i16],
    bytes: &'a mut [u8],
    sign: i32,
}

impl Kernel for Row<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let n = self.bytes.len();
        let (before, after) = (&self.smoothed[..n], &self.smoothed[2..n + 2]);
        for (byte, (before, after)) in self.bytes.iter_mut().zip(before.iter().zip(after)) {
            let difference = (self.sign * (i32::from(*after) - i32::from(*before))) >> SHIFT;
            *byte = (difference.clamp(-LARGEST, LARGEST) + i32::from(ZERO)) as u8;
        }
    }
}
