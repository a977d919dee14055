//! What matching needs of one stereo frame, computed once.

use super::pyramid::Pyramid;
use super::spline::smoothed_coefficients;
use crate::geometry::{Grid, Image};

/// Pyramids and spline coefficients of a rectified pair, both of the smoothed images.
#[derive(Debug, Clone)]
pub struct StereoPyramid {
    /// Pyramid of the left image.
    pub left: Pyramid,
    /// Pyramid of the right image.
    pub right: Pyramid,
    /// Spline coefficients of the left image.
    pub left_spline: Image,
    /// Spline coefficients of the right image.
    pub right_spline: Image,
}

impl StereoPyramid {
    /// Pyramids of up to `levels` levels.
    pub fn new(left: &Image, right: &Image, levels: usize) -> Self {
        let empty = || Grid::filled(0, 0, 0.0);
        let mut pyramid = Self {
            left: Pyramid::new(empty(), 1),
            right: Pyramid::new(empty(), 1),
            left_spline: empty(),
            right_spline: empty(),
        };
        pyramid.renew(left, right, levels);
        pyramid
    }

    /// The same of another frame, in the memory of this one.
    pub fn renew(&mut self, left: &Image, right: &Image, levels: usize) {
        let side = |image: &Image, pyramid: &mut Pyramid, spline: &mut Image| {
            pyramid.renew(image, levels);
            smoothed_coefficients(image, spline);
        };
        rayon::join(
            || side(left, &mut self.left, &mut self.left_spline),
            || side(right, &mut self.right, &mut self.right_spline),
        );
    }
}
