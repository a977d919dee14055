//! Image pyramid and image gradients, computed once per frame and shared by flow and tracks.

use crate::geometry::{Grid, Image};
use rayon::prelude::*;

/// Levels of which the smaller side would be under this many pixels are not built.
const MIN_SIDE: usize = 8;

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
        let mut levels = vec![image];
        while levels.len() < max_levels {
            let Some(next) = levels.last().map(halve) else { break };
            if next.width().min(next.height()) < MIN_SIDE {
                break;
            }
            levels.push(next);
        }
        Self { levels }
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

/// The image smoothed by the binomial (1 2 1)/4 in both directions, border pixels repeated.
///
/// Sub-pixel interpolation is only as good as the image is smooth: without this a displacement of a
/// fraction of a pixel comes out several per cent too large or too small on fine texture.
pub fn smooth(image: &Image) -> Image {
    let (width, height) = image.size();
    let mut out = Grid::filled(width, height, 0.0_f32);
    out.values_mut().par_chunks_mut(width.max(1)).enumerate().for_each_init(
        || vec![0.0_f32; width + 2],
        |line, (y, out)| {
            let (above, here, below) =
                (image.row(y.saturating_sub(1)), image.row(y), image.row((y + 1).min(height - 1)));
            for (x, s) in line[1..=width].iter_mut().enumerate() {
                *s = 0.25 * (above[x] + below[x]) + 0.5 * here[x];
            }
            (line[0], line[width + 1]) = (line[1], line[width]);
            for (x, o) in out.iter_mut().enumerate() {
                *o = 0.25 * (line[x] + line[x + 2]) + 0.5 * line[x + 1];
            }
        },
    );
    out
}

/// Smooth by the binomial (1 4 6 4 1)/16 and keep every second pixel.
fn halve(image: &Image) -> Image {
    let (width, height) = image.size();
    let mut half = Grid::filled(width.div_ceil(2), height.div_ceil(2), 0.0_f32);
    let half_width = half.width().max(1);
    half.values_mut().par_chunks_mut(half_width).enumerate().for_each_init(
        || vec![0.0_f32; width + 4],
        |smooth, (y, out)| {
            let row = |dy: usize| image.row((2 * y + dy).saturating_sub(2).min(height - 1));
            let rows = [row(0), row(1), row(2), row(3), row(4)];
            for (x, s) in smooth[2..width + 2].iter_mut().enumerate() {
                *s = (rows[0][x] + rows[4][x] + 4.0 * (rows[1][x] + rows[3][x]) + 6.0 * rows[2][x]) / 16.0;
            }
            let (first, last) = (smooth[2], smooth[width + 1]);
            smooth[..2].fill(first);
            smooth[width + 2..].fill(last);
            for (x, o) in out.iter_mut().enumerate() {
                let s = &smooth[2 * x..2 * x + 5];
                *o = (s[0] + s[4] + 4.0 * (s[1] + s[3]) + 6.0 * s[2]) / 16.0;
            }
        },
    );
    half
}

/// Derivatives of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradients {
    /// ∂I/∂u, in grey levels per pixel.
    pub du: Grid<f32>,
    /// ∂I/∂v, in grey levels per pixel.
    pub dv: Grid<f32>,
}

/// Variance of one component of [`gradients`] caused by white noise of variance 1 in the image:
/// Σ of the squared weights of ½(−1 0 1) × (3 10 3)/16.
pub const GRADIENT_NOISE_GAIN: f32 = 0.5 * (9.0 + 100.0 + 9.0) / 256.0;

/// Scharr's 3×3 derivatives, ½(−1 0 1) along and (3 10 3)/16 across; border pixels repeated.
pub fn gradients(image: &Image) -> Gradients {
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
