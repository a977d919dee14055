//! The census transform: each pixel as the order of its neighbourhood.
//!
//! R. Zabih, J. Woodfill, "Non-parametric local transforms for computing visual correspondence",
//! ECCV 1994.

use rayon::prelude::*;

use super::smoothing::Smoothed;
use crate::geometry::Image;
use crate::simd::{Bytes, Kernel, LANES, widest};

/// Half the side of the square neighbourhood that is compared with its centre, in pixels: a larger one is surer where
/// there is little texture, and blurs depth edges.
const RADIUS: usize = 2;
/// Side of the neighbourhood, in pixels.
const SIDE: usize = 2 * RADIUS + 1;
/// Number of comparisons: the greatest Hamming distance, and so the largest matching cost.
pub(super) const COMPARISONS: usize = SIDE * SIDE - 1;
/// Bits of a word that lie side by side in a plane.
const BITS: usize = 8;
/// Planes of bytes that hold a word.
pub(super) const PLANES: usize = COMPARISONS / BITS;

/// Neighbours, as (column, row) counted from the top left of the neighbourhood.
const NEIGHBOURS: [(usize, usize); COMPARISONS] = {
    let mut neighbours = [(0, 0); COMPARISONS];
    let mut i = 0;
    while i < COMPARISONS {
        // The centre is left out.
        let place = if i < COMPARISONS / 2 { i } else { i + 1 };
        neighbours[i] = (place % SIDE, place / SIDE);
        i += 1;
    }
    neighbours
};

/// The census words of an image as planes of bytes, eight comparisons in each.
///
/// In rows of `stride` bytes of plane after plane.
#[derive(Debug, Clone, Default)]
pub(super) struct Census {
    smoothed: Smoothed,
    bytes: Vec<u8>,
    /// Bytes from one plane of a row to the next.
    pub stride: usize,
}

impl Census {
    /// The words of `image`, of the last column first if `mirrored`.
    ///
    /// The image is smoothed first: that calms the noise of the order, and forgives the fractions of a
    /// row by which rectification is wrong. Outside the image the nearest pixel counts.
    pub(super) fn compute(&mut self, image: &Image, scale: f32, mirrored: bool) {
        let (width, height) = image.size();
        let mut neighbours = NEIGHBOURS;
        if mirrored {
            neighbours.iter_mut().for_each(|(i, _)| *i = 2 * RADIUS - *i);
        }
        self.stride = width.next_multiple_of(LANES);
        self.bytes.resize(self.stride * PLANES * height, 0);
        if self.bytes.is_empty() {
            return;
        }
        self.smoothed.compute(image, RADIUS, scale, mirrored);
        let Self { smoothed, bytes, stride, .. } = self;
        bytes.par_chunks_mut(*stride * PLANES).enumerate().for_each(|(v, bytes)| {
            let row = |j: usize| smoothed.row((v + j).saturating_sub(RADIUS).min(height - 1));
            let rows = std::array::from_fn(row);
            widest(CompareWithCentre { rows, neighbours: &neighbours, bytes, stride: *stride });
        });
    }

    /// Plane after plane of row `v`.
    pub(super) fn row(&self, v: usize) -> &[u8] {
        let size = self.stride * PLANES;
        &self.bytes[v * size..(v + 1) * size]
    }
}

/// The bytes of a row from the smoothed rows of its neighbourhood.
struct CompareWithCentre<'a> {
    rows: [&'a [i16]; SIDE],
    neighbours: &'a [(usize, usize); COMPARISONS],
    bytes: &'a mut [u8],
    stride: usize,
}

impl Kernel for CompareWithCentre<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let line = |(i, j): (usize, usize)| &self.rows[j][i..i + self.stride];
        let centre = line((RADIUS, RADIUS));
        let planes = self.bytes.chunks_exact_mut(self.stride).zip(self.neighbours.as_chunks::<BITS>().0);
        for (plane, neighbours) in planes {
            let lines = neighbours.map(line);
            for (part, bytes) in plane.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                let at = part * LANES..(part + 1) * LANES;
                let mut bits = [0_i16; LANES];
                for neighbour in lines {
                    let pairs = neighbour[at.clone()].iter().zip(&centre[at.clone()]);
                    for (bits, (neighbour, centre)) in bits.iter_mut().zip(pairs) {
                        *bits = *bits << 1 | i16::from(neighbour < centre);
                    }
                }
                for (byte, bits) in bytes.iter_mut().zip(bits) {
                    *byte = bits as u8;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::smoothing::grey_scale;
    use super::*;

    fn census(image: &Image, mirrored: bool) -> Census {
        let mut census = Census::default();
        census.compute(image, grey_scale([image, image]), mirrored);
        census
    }

    /// The bytes of the word of a pixel.
    fn word(census: &Census, u: usize, v: usize) -> [u8; PLANES] {
        std::array::from_fn(|k| census.row(v)[k * census.stride + u])
    }

    #[test]
    fn words_depend_on_order_alone() {
        let image = Image::from_fn(13, 11, |u, v| ((u * 37 + v * 101) % 53) as f32);
        let brighter = Image::from_fn(13, 11, |u, v| 7.0 + 300.0 * image.at(u, v));
        assert_eq!(census(&image, false).bytes, census(&brighter, false).bytes);
    }

    #[test]
    fn every_comparison_has_its_bit() {
        let mut peak = Image::filled(15, 15, 1.0);
        peak.set(7, 7, 2.0);
        let census = census(&peak, false);
        let bits = |u, v| word(&census, u, v).iter().map(|b| b.count_ones()).sum::<u32>();
        // Smoothing spreads the peak over 3 × 3 pixels; all others are nowhere brighter.
        assert_eq!(bits(7, 7), COMPARISONS as u32);
        assert_eq!((0..225).filter(|i| bits(i % 15, i / 15) > 0).count(), 9);
    }

    #[test]
    fn a_mirrored_image_has_the_same_words_in_turn() {
        let image = Image::from_fn(40, 9, |u, v| ((u * 29 + v * 83) % 47) as f32);
        let (plain, mirrored) = (census(&image, false), census(&image, true));
        for (u, v) in (0..360).map(|i| (i % 40, i / 40)) {
            assert_eq!(word(&plain, u, v), word(&mirrored, 39 - u, v));
        }
    }
}
