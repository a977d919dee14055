//! The partition of an image into blocks: neighbouring pixels share their noise, blocks of them hardly do.

use nalgebra::{SMatrix, SVector};

use crate::geometry::StereoRig;

/// The partition of an image into square blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blocks {
    size_px: f64,
    origin_px: (f64, f64),
    columns: usize,
    rows: usize,
}

impl Blocks {
    /// Blocks of `size_px` pixels over the left image of a rig.
    pub fn tiling(rig: &StereoRig, size_px: f64) -> Self {
        let size = size_px.max(1.0);
        let count = |n: usize| ((n as f64 / size).ceil() as usize).max(1);
        let origin_px = rig.image_from_pixel(-0.5, -0.5);
        Self { size_px: size, origin_px, columns: count(rig.width_px), rows: count(rig.height_px) }
    }

    /// Number of blocks.
    pub fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// The block of image coordinates (x, y); outside the image, the nearest one.
    pub fn index(&self, x: f64, y: f64) -> usize {
        let cell = |c: f64, origin: f64, n: usize| {
            // The conversion rounds down, and takes what is negative to zero.
            (((c - origin) / self.size_px) as usize).min(n - 1)
        };
        cell(y, self.origin_px.1, self.rows) * self.columns + cell(x, self.origin_px.0, self.columns)
    }
}

/// What one block says at the estimate: its information Σ w a aᵀ and its score Σ w a r.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BlockScore<const N: usize> {
    /// Information, N×N.
    pub information: SMatrix<f64, N, N>,
    /// Score.
    pub score: SVector<f64, N>,
}

impl<const N: usize> Default for BlockScore<N> {
    fn default() -> Self {
        Self { information: SMatrix::zeros(), score: SVector::zeros() }
    }
}
