//! Blur of the optics: a Gaussian point spread function.

use rayon::prelude::*;

use crate::geometry::{Grid, Image};

/// The point spread function ends at this many of its σ.
const REACH_SIGMAS: f64 = 4.0;
/// Largest σ, in pixels; beyond it an image shows nothing.
pub(super) const MAX_SIGMA_PX: f64 = 64.0;

/// How far the light of a point spreads, in whole pixels; 0 without blur.
pub(super) fn reach_px(sigma_px: f64) -> usize {
    (REACH_SIGMAS * sigma_px.clamp(0.0, MAX_SIGMA_PX)).ceil() as usize
}

/// The image blurred with σ in pixels, without the `margin` pixels on each of its sides.
///
/// Where the point spread function reaches beyond the image, its weights inside are scaled to sum to 1; with a
/// margin of [`reach_px`] it never does, and the borders are as true as the middle.
pub(super) fn blurred(image: &Image, sigma_px: f64, margin: usize) -> Image {
    let (width, height) = image.size();
    let reach = reach_px(sigma_px);
    let inner = |size: usize| size.saturating_sub(2 * margin);
    let (inner_width, inner_height) = (inner(width), inner(height));
    // Down the columns first, whole rows at a time.
    let mut rows: Image = Grid::filled(width, inner_height, 0.0);
    rows.values_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(v, row)| {
        let mut sums = vec![0.0_f64; width];
        for (source, weight) in taps(v + margin, height, reach, sigma_px) {
            sums.iter_mut().zip(image.row(source)).for_each(|(sum, &grey)| *sum += weight * f64::from(grey));
        }
        row.iter_mut().zip(sums).for_each(|(grey, sum)| *grey = sum as f32);
    });
    let across: Vec<_> = (0..inner_width).map(|u| taps(u + margin, width, reach, sigma_px)).collect();
    let mut image = Grid::filled(inner_width, inner_height, 0.0);
    image.values_mut().par_chunks_mut(inner_width.max(1)).enumerate().for_each(|(v, row)| {
        let source = rows.row(v);
        for (grey, taps) in row.iter_mut().zip(&across) {
            *grey = taps.iter().map(|&(u, weight)| weight * f64::from(source[u])).sum::<f64>() as f32;
        }
    });
    image
}

/// The pixels of a line of `size` that a pixel receives light from, and their shares, which sum to 1.
fn taps(centre: usize, size: usize, reach: usize, sigma_px: f64) -> Vec<(usize, f64)> {
    let weight = |place: usize| {
        let away = place.abs_diff(centre) as f64;
        if away == 0.0 { 1.0 } else { (-0.5 * (away / sigma_px).powi(2)).exp() }
    };
    let places = centre.saturating_sub(reach)..(centre + reach + 1).min(size);
    let sum: f64 = places.clone().map(weight).sum();
    places.map(|place| (place, weight(place) / sum)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_becomes_a_gaussian_of_the_same_light() {
        let sigma = 1.7;
        let mut point: Image = Grid::filled(41, 31, 0.0);
        point.set(20, 15, 1000.0);
        let spread = blurred(&point, sigma, 0);
        let (mut light, mut across, mut down) = (0.0, 0.0, 0.0);
        for v in 0..31 {
            for u in 0..41 {
                let (x, y, grey) = (u as f64 - 20.0, v as f64 - 15.0, f64::from(spread.at(u, v)));
                // The continuous Gaussian at the pixel's centre.
                let want = 1000.0 * (-0.5 * (x * x + y * y) / (sigma * sigma)).exp()
                    / (std::f64::consts::TAU * sigma * sigma);
                assert!((grey - want).abs() < 0.02, "{u} {v} {grey} {want}");
                light += grey;
                across += x * x * grey;
                down += y * y * grey;
            }
        }
        assert!((light - 1000.0).abs() < 0.01, "{light}");
        // 4σ leave .1 % of the second moment out.
        for moment in [across, down] {
            assert!((moment / light / (sigma * sigma) - 1.0).abs() < 3e-3, "{}", moment / light);
        }
    }

    #[test]
    fn borders_neither_darken_nor_brighten() {
        let flat: Image = Grid::filled(9, 7, 80.0);
        assert!(blurred(&flat, 2.5, 0).values().iter().all(|g| (g - 80.0).abs() < 1e-4));
        // A blur wider than the image levels it.
        let step: Image = Grid::from_fn(8, 1, |u, _| if u < 4 { 0.0 } else { 100.0 });
        assert!(blurred(&step, 60.0, 0).values().iter().all(|g| (g - 50.0).abs() < 1.0));
    }

    #[test]
    fn without_blur_the_margin_goes_and_nothing_else() {
        let image: Image = Grid::from_fn(9, 8, |u, v| (10 * u + v) as f32);
        assert_eq!(reach_px(0.0), 0);
        assert_eq!(blurred(&image, 0.0, 0), image);
        assert_eq!(blurred(&image, 0.0, 2), Grid::from_fn(5, 4, |u, v| (10 * (u + 2) + v + 2) as f32));
        assert_eq!(blurred(&image, 1.0, 5).size(), (0, 0));
    }
}
