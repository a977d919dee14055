//! The census transform: each pixel as the order of its neighbourhood.
//!
//! R. Zabih, J. Woodfill, "Non-parametric local transforms for computing visual correspondence",
//! ECCV 1994; R. Spangenberg, T. Langner, R. Rojas, "Weighted semi-global matching and
//! center-symmetric census transform for robust driver assistance", CAIP 2013.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::lanes::{Bytes, Kernel, LANES, widest};
use super::smoothing::Smoothed;
use crate::geometry::Image;

/// The neighbourhood of the census transform, width × height in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CensusWindow {
    /// 5 × 5 against the centre, 24 bits: sharp depth edges.
    #[default]
    FiveByFive,
    /// 7 × 7 against the centre, 48 bits.
    SevenBySeven,
    /// 9 × 7 against the centre, 62 bits.
    NineBySeven,
    /// 9 × 7, each pixel against the one opposite of the centre, 31 bits: half the work.
    Symmetric,
}

impl CensusWindow {
    /// Half width and half height, in pixels.
    fn radii(self) -> (usize, usize) {
        match self {
            Self::FiveByFive => (2, 2),
            Self::SevenBySeven => (3, 3),
            Self::NineBySeven | Self::Symmetric => (4, 3),
        }
    }

    /// Number of comparisons, at most 64: the greatest Hamming distance.
    pub fn bits(self) -> u32 {
        let (ru, rv) = self.radii();
        let neighbours = ((2 * ru + 1) * (2 * rv + 1) - 1) as u32;
        if self == Self::Symmetric { neighbours / 2 } else { neighbours }
    }

    /// What is compared, filled up to whole bytes with comparisons that never hold.
    fn comparisons(self) -> Vec<Comparison> {
        let (ru, rv) = self.radii();
        let (width, height) = (2 * ru + 1, 2 * rv + 1);
        let pixels: Vec<_> = (0..width * height).map(|i| (i % width, i / width)).collect();
        let centre = pixels.len() / 2;
        let mut comparisons: Vec<Comparison> = match self {
            Self::Symmetric => {
                pixels[..centre].iter().map(|&(i, j)| [(i, j), (2 * ru - i, 2 * rv - j)]).collect()
            }
            _ => pixels.iter().filter(|&&p| p != pixels[centre]).map(|&p| [p, pixels[centre]]).collect(),
        };
        comparisons.resize(comparisons.len().next_multiple_of(BITS), [pixels[centre]; 2]);
        comparisons
    }
}

/// Two pixels of the window, as (column, row) counted from its top left.
type Comparison = [(usize, usize); 2];

/// Largest matching cost: of words of more bits half the distance counts.
pub(super) const LARGEST_COST: u8 = 31;
/// Bits of a word that lie side by side in a plane.
const BITS: usize = 8;

/// The census words of an image as planes of bytes, eight comparisons in each.
///
/// In rows of `stride` bytes of plane after plane.
#[derive(Debug, Clone, Default)]
pub(super) struct Census {
    smoothed: Smoothed,
    bytes: Vec<u8>,
    /// Planes of a row.
    pub planes: usize,
    /// Bytes from one plane of a row to the next.
    pub stride: usize,
    /// Whether the matching cost is half of the distance.
    pub halve: bool,
}

impl Census {
    /// The words of `image`, of the last column first if `mirrored`.
    ///
    /// The image is smoothed first: that calms the noise of the order, and forgives the fractions of a
    /// row by which rectification is wrong. Outside the image the nearest pixel counts.
    pub fn compute(&mut self, image: &Image, window: CensusWindow, scale: f32, mirrored: bool) {
        let (width, height) = image.size();
        let (ru, rv) = window.radii();
        let mut comparisons = window.comparisons();
        if mirrored {
            comparisons.iter_mut().flatten().for_each(|(i, _)| *i = 2 * ru - *i);
        }
        self.planes = comparisons.len().div_ceil(BITS);
        self.stride = width.next_multiple_of(LANES);
        self.bytes.resize(self.stride * self.planes * height, 0);
        if self.bytes.is_empty() {
            return;
        }
        self.halve = window.bits() > LARGEST_COST.into();
        self.smoothed.compute(image, ru, scale, mirrored);
        let Self { smoothed, bytes, planes, stride, .. } = self;
        bytes.par_chunks_mut(*stride * *planes).enumerate().for_each_init(Vec::new, |rows, (v, bytes)| {
            rows.clear();
            rows.extend((0..=2 * rv).map(|j| smoothed.row((v + j).saturating_sub(rv).min(height - 1))));
            widest(Compare { rows, comparisons: &comparisons, bytes, stride: *stride });
        });
    }

    /// Plane after plane of row `v`.
    pub fn row(&self, v: usize) -> &[u8] {
        let size = self.stride * self.planes;
        &self.bytes[v * size..(v + 1) * size]
    }
}

/// The bytes of a row from the smoothed rows of its window.
struct Compare<'a> {
    rows: &'a [&'a [i16]],
    comparisons: &'a [Comparison],
    bytes: &'a mut [u8],
    stride: usize,
}

impl Kernel for Compare<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let planes = self.bytes.chunks_exact_mut(self.stride).zip(self.comparisons.as_chunks::<BITS>().0);
        for (plane, comparisons) in planes {
            let line = |(i, j): (usize, usize)| &self.rows[j][i..i + self.stride];
            let lines = comparisons.map(|[a, b]| [line(a), line(b)]);
            for (part, bytes) in plane.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                let at = part * LANES..(part + 1) * LANES;
                let mut bits = [0_i16; LANES];
                for [a, b] in lines {
                    for (bits, (a, b)) in bits.iter_mut().zip(a[at.clone()].iter().zip(&b[at.clone()])) {
                        *bits = *bits << 1 | i16::from(a < b);
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

    const WINDOWS: [CensusWindow; 4] = [
        CensusWindow::FiveByFive,
        CensusWindow::SevenBySeven,
        CensusWindow::NineBySeven,
        CensusWindow::Symmetric,
    ];

    fn census(image: &Image, window: CensusWindow, mirrored: bool) -> Census {
        let mut census = Census::default();
        census.compute(image, window, grey_scale([image, image]), mirrored);
        census
    }

    /// The bytes of the word of a pixel.
    fn word(census: &Census, u: usize, v: usize) -> Vec<u8> {
        (0..census.planes).map(|k| census.row(v)[k * census.stride + u]).collect()
    }

    #[test]
    fn words_depend_on_order_alone() {
        let image = Image::from_fn(13, 11, |u, v| ((u * 37 + v * 101) % 53) as f32);
        let brighter = Image::from_fn(13, 11, |u, v| 7.0 + 300.0 * image.at(u, v));
        for window in WINDOWS {
            let (a, b) = (census(&image, window, false), census(&brighter, window, false));
            assert_eq!(a.bytes, b.bytes);
        }
    }

    #[test]
    fn every_comparison_has_its_bit() {
        let mut peak = Image::filled(15, 15, 1.0);
        peak.set(7, 7, 2.0);
        for window in WINDOWS {
            let census = census(&peak, window, false);
            let bits = |u, v| word(&census, u, v).iter().map(|b| b.count_ones()).sum::<u32>();
            // Smoothing spreads the peak over 3 × 3 pixels; all others are nowhere brighter. Of pixels
            // opposite of the middle none differ.
            let expected = if window == CensusWindow::Symmetric { 0 } else { window.bits() };
            assert_eq!(bits(7, 7), expected);
            let set = (0..225).filter(|i| bits(i % 15, i / 15) > 0).count();
            assert_eq!(set, if window == CensusWindow::Symmetric { set } else { 9 });
        }
    }

    #[test]
    fn a_mirrored_image_has_the_same_words_in_turn() {
        let image = Image::from_fn(40, 9, |u, v| ((u * 29 + v * 83) % 47) as f32);
        for window in WINDOWS {
            let (plain, mirrored) = (census(&image, window, false), census(&image, window, true));
            for (u, v) in (0..360).map(|i| (i % 40, i / 40)) {
                assert_eq!(word(&plain, u, v), word(&mirrored, 39 - u, v));
            }
        }
    }
}
