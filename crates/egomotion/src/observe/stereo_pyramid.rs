//! What matching needs of one stereo frame, computed once.

use super::pyramid::Pyramid;
use super::spline::smoothed_coefficients;
use crate::geometry::{Grid, Image};

/// Pyramids and spline coefficients of a rectified pair, both of the smoothed images.
///
/// Without a right image its planes are empty: nothing is found in them.
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

impl Default for StereoPyramid {
    fn default() -> Self {
        let empty = || Grid::filled(0, 0, 0.0);
        Self {
            left: Pyramid::new(empty(), 1),
            right: Pyramid::new(empty(), 1),
            left_spline: empty(),
            right_spline: empty(),
        }
    }
}

impl StereoPyramid {
    /// Pyramids of up to `levels` levels.
    pub fn new(left: &Image, right: &Image, levels: usize) -> Self {
        let mut pyramid = Self::default();
        pyramid.renew(left, Some(right), levels);
        pyramid
    }

    /// The same of another frame, in the memory of this one.
    pub fn renew(&mut self, left: &Image, right: Option<&Image>, levels: usize) {
        let side = |image: &Image, pyramid: &mut Pyramid, spline: &mut Image| {
            pyramid.renew(image, levels);
            smoothed_coefficients(image, spline);
        };
        let Some(right) = right else {
            (self.right, self.right_spline) = (Self::default().right, Grid::filled(0, 0, 0.0));
            return side(left, &mut self.left, &mut self.left_spline);
        };
        rayon::join(
            || side(left, &mut self.left, &mut self.left_spline),
            || side(right, &mut self.right, &mut self.right_spline),
        );
    }

    /// Whether there is a right image.
    pub fn has_right(&self) -> bool {
        self.right.size() != (0, 0)
    }

    /// Whether both images are those of another frame, to the last bit.
    pub fn repeats(&self, other: &Self) -> bool {
        let same = |a: &Pyramid, b: &Pyramid| a.levels().first() == b.levels().first();
        same(&self.left, &other.left) && same(&self.right, &other.right)
    }
}
