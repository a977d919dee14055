//! The census transform: each pixel as the order of its neighbourhood.
//!
//! R. Zabih, J. Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994.

use std::cmp::Ordering;

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
/// The image is smoothed first (binomial, 3 × 3): that calms the noise of the order, and forgives
/// the fractions of a row by which rectification is wrong. Outside the image the nearest pixel counts.
pub(super) fn transform(image: &Image, window: CensusWindow, smoothed: &mut Vec<f32>, words: &mut Vec<u64>) {
    let (width, height) = image.size();
    let (ru, rv) = window.radii();
    let stride = width + 2 * ru;
    words.resize(width * height, 0);
    smoothed.resize(stride * height, 0.0);
    if words.is_empty() {
        return;
    }
    smoothed.par_chunks_mut(stride).enumerate().for_each(|(v, row)| smooth_row(image, v, row, ru));
    words.par_chunks_mut(width).enumerate().for_each(|(v, words)| {
        let row = |v: usize| &smoothed[v * stride..(v + 1) * stride];
        let centre = &row(v)[ru..ru + width];
        // Two halves of 32 bits vectorise twice as wide as one word of 64.
        let (mut high, mut low) = (vec![0_u32; width], vec![0_u32; width]);
        for j in 0..=2 * rv {
            let neighbours = row((v + j).saturating_sub(rv).min(height - 1));
            for i in 0..=2 * ru {
                match (j, i).cmp(&(rv, ru)) {
                    Ordering::Less => push_bit(&mut high, &neighbours[i..i + width], centre),
                    Ordering::Equal => {}
                    Ordering::Greater => push_bit(&mut low, &neighbours[i..i + width], centre),
                }
            }
        }
        for (word, (high, low)) in words.iter_mut().zip(high.iter().zip(&low)) {
            *word = u64::from(*high) << 32 | u64::from(*low);
        }
    });
}

/// Row `v` smoothed by (1, 2, 1)/4 both ways, continued by `margin` copies of its ends.
fn smooth_row(image: &Image, v: usize, smoothed: &mut [f32], margin: usize) {
    let (width, height) = image.size();
    let (above, here) = (image.row(v.saturating_sub(1)), image.row(v));
    let below = image.row((v + 1).min(height - 1));
    let column: Vec<f32> = (0..width).map(|u| above[u] + 2.0 * here[u] + below[u]).collect();
    for (i, value) in smoothed.iter_mut().enumerate() {
        let u = i.saturating_sub(margin).min(width - 1);
        *value = column[u.saturating_sub(1)] + 2.0 * column[u] + column[(u + 1).min(width - 1)];
    }
}

/// Append to each word whether the neighbour is darker than the centre.
fn push_bit(words: &mut [u32], neighbours: &[f32], centres: &[f32]) {
    for ((word, n), c) in words.iter_mut().zip(neighbours).zip(centres) {
        *word = *word << 1 | u32::from(n < c);
    }
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
            transform(&image, window, &mut Vec::new(), &mut a);
            transform(&brighter, window, &mut Vec::new(), &mut b);
            assert_eq!(a, b);
        }
    }

    #[test]
    fn every_neighbour_has_its_bit() {
        for window in [CensusWindow::FiveByFive, CensusWindow::SevenBySeven, CensusWindow::NineBySeven] {
            let mut peak = Image::filled(15, 15, 1.0);
            peak.set(7, 7, 2.0);
            let mut words = Vec::new();
            transform(&peak, window, &mut Vec::new(), &mut words);
            assert_eq!(words[7 * 15 + 7].count_ones(), window.bits());
            // Smoothing spreads the peak over 3 × 3 pixels; all others are nowhere brighter.
            assert_eq!(words.iter().filter(|w| **w != 0).count(), 9);
        }
    }
}
