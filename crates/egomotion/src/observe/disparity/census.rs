//! The census transform: each pixel as the order of its neighbourhood.
//!
//! R. Zabih, J. Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::Image;

/// The neighbourhood of the census transform, width × height in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CensusWindow {
    /// 5 × 5, 24 bits: sharper depth edges, less robust.
    FiveByFive,
    /// 7 × 7, 48 bits.
    SevenBySeven,
    /// 9 × 7, 62 bits.
    #[default]
    NineBySeven,
}

impl CensusWindow {
    /// Half width and half height, in pixels.
    fn radii(self) -> (usize, usize) {
        match self {
            Self::FiveByFive => (2, 2),
            Self::SevenBySeven => (3, 3),
            Self::NineBySeven => (4, 3),
        }
    }

    /// Number of neighbours compared, at most 64: the greatest Hamming distance.
    pub fn bits(self) -> u32 {
        let (ru, rv) = self.radii();
        ((2 * ru + 1) * (2 * rv + 1) - 1) as u32
    }
}

/// The census words of an image, row by row: bit = neighbour darker than the pixel.
///
/// Outside the image the nearest pixel counts.
pub(super) fn transform(image: &Image, window: CensusWindow, words: &mut Vec<u64>) {
    let (width, height) = image.size();
    let (ru, rv) = window.radii();
    words.clear();
    words.resize(width * height, 0);
    if words.is_empty() {
        return;
    }
    words.par_chunks_mut(width).enumerate().for_each(|(v, words)| {
        let rows: Vec<Vec<f32>> =
            (0..=2 * rv).map(|j| padded(image.row((v + j).saturating_sub(rv).min(height - 1)), ru)).collect();
        // Two halves of 32 bits vectorise twice as wide as one word of 64.
        let half = rows.len() / 2;
        let centre = image.row(v);
        let mut low = vec![0_u32; width];
        let mut high = vec![0_u32; width];
        for (j, row) in rows.iter().enumerate() {
            for i in 0..=2 * ru {
                if (i, j) == (ru, rv) {
                    continue;
                }
                let upper = j < half || (j == half && i < ru);
                push_bit(if upper { &mut high } else { &mut low }, &row[i..i + width], centre);
            }
        }
        for (word, (low, high)) in words.iter_mut().zip(low.iter().zip(&high)) {
            *word = u64::from(*high) << 32 | u64::from(*low);
        }
    });
}

/// Append to each word whether the neighbour is darker than the centre.
fn push_bit(words: &mut [u32], neighbours: &[f32], centres: &[f32]) {
    for ((word, n), c) in words.iter_mut().zip(neighbours).zip(centres) {
        *word = *word << 1 | u32::from(n < c);
    }
}

/// A row continued by `margin` copies of its ends.
fn padded(row: &[f32], margin: usize) -> Vec<f32> {
    let ends = |end: Option<&f32>| std::iter::repeat_n(end.copied().unwrap_or_default(), margin);
    ends(row.first()).chain(row.iter().copied()).chain(ends(row.last())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_depend_on_order_alone() {
        let image = Image::from_fn(13, 11, |u, v| ((u * 37 + v * 101) % 53) as f32);
        let brighter = Image::from_fn(13, 11, |u, v| 7.0 + 300.0 * image.at(u, v));
        for window in [CensusWindow::FiveByFive, CensusWindow::SevenBySeven, CensusWindow::NineBySeven] {
            let (mut a, mut b) = (Vec::new(), Vec::new());
            transform(&image, window, &mut a);
            transform(&brighter, window, &mut b);
            assert_eq!(a, b);
        }
    }

    #[test]
    fn every_neighbour_has_its_bit() {
        for window in [CensusWindow::FiveByFive, CensusWindow::SevenBySeven, CensusWindow::NineBySeven] {
            let mut peak = Image::filled(15, 15, 1.0);
            peak.set(7, 7, 2.0);
            let mut words = Vec::new();
            transform(&peak, window, &mut words);
            assert_eq!(words[7 * 15 + 7].count_ones(), window.bits());
            assert_eq!(words.iter().filter(|w| **w != 0).count(), 1);
        }
    }
}
