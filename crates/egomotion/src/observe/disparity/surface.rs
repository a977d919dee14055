//! The mean of each pixel's surface: smoothing that stops at depth edges.

use super::lanes::{Bytes, Kernel};

/// Half width and half height of the windows, in pixels.
pub(super) const RADIUS: (usize, usize) = (4, 3);
/// Disparity difference up to which a pixel of the window is of the same surface: at the centre, and
/// per pixel of distance from it.
const SAME_SURFACE: (f32, f32) = (0.5, 0.25);

/// The mean over the pixels `lines[k][i]`, k = 0 …, that are of the surface of `centre[i]`.
///
/// Missing where the centre is (NaN); pixels that are missing do not count.
pub(super) struct SurfaceMean<'a, const N: usize> {
    /// The middle one may be the centre's own line.
    pub lines: [&'a [f32]; N],
    pub centre: &'a [f32],
    pub mean: &'a mut [f32],
    /// Share of the pixels that are of the surface, 0 … 1: times what it was, unless `first`.
    pub support: &'a mut [f32],
    pub first: bool,
}

impl<const N: usize> Kernel for SurfaceMean<'_, N> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let n = self.mean.len();
        let lines = self.lines.map(|line| &line[..n]);
        let centre = &self.centre[..n];
        let support = &mut self.support[..n];
        if self.first {
            support.fill(1.0);
        }
        for i in 0..n {
            let (mut count, mut sum) = (0.0, 0.0);
            for (k, line) in lines.iter().enumerate() {
                let change = line[i] - centre[i];
                let tolerance = SAME_SURFACE.0 + SAME_SURFACE.1 * k.abs_diff(N / 2) as f32;
                // A mask instead of a choice: it vectorises, and is safe where the change is NaN.
                let same = if change.abs() <= tolerance { u32::MAX } else { 0 };
                count += f32::from_bits(same & 1.0_f32.to_bits());
                sum += f32::from_bits(same & change.to_bits());
            }
            self.mean[i] = centre[i] + sum / count;
            support[i] *= count / N as f32;
        }
    }
}
