//! Sub-pixel disparity with its standard deviation: photometric refinement along the row.
//!
//! One Gauss–Newton step of B. Lucas and T. Kanade, "An iterative image registration technique with
//! an application to stereo vision", IJCAI 1981, repeated. Each pixel of the window is compared at
//! its *own* disparity, so the window follows slanted and curved surfaces, and beyond a depth edge
//! a pixel asks for its own correction, which is as small as that of the window's centre. The
//! disparity of the semi-global matching enters as a prior, which alone remains where there is no
//! texture.

use rayon::prelude::*;

use super::compare::{CompareRow, RowOffset, rows_beside};
use super::lucas_kanade::{CorrectionRow, DifferenceRow, Posterior, RADIUS, SolveWindows, row_length};
use crate::geometry::{Image, upper_median};
use crate::observe::spline;
use crate::simd::{Bytes, Kernel, widest};

/// Gauss–Newton steps: each compares the images at what the one before found, so more cost time.
const STEPS: usize = 2;
/// Every so many pixels are sampled for the median of the noise over the image: a prime number, so that the samples
/// do not fall into the same columns of every row.
const NOISE_SAMPLING_PX: usize = 61;
/// Disparity difference up to which a pixel of the window is of the same surface, in pixels: at the centre, and
/// per pixel of distance from it.
const SAME_SURFACE_PX: (f32, f32) = (0.5, 0.25);

/// The planes of the refinement, with a margin of at least RADIUS.0 pixels at either end of a row.
#[derive(Debug, Clone, Default)]
pub(super) struct Refinement {
    width: usize,
    /// Semi-global disparity smoothed over the surface; NaN is missing.
    prior: Vec<f32>,
    /// Disparity at which the images are compared; NaN is missing.
    disparity: Vec<f32>,
    /// Smoothed along rows alone.
    along: Vec<f32>,
    /// Share of the window that is of the pixel's surface, 0 … 1.
    support: Vec<f32>,
    /// 1, left minus right grey level there, and its derivative by the disparity; 0 where missing.
    weight: Vec<f32>,
    difference: Vec<f32>,
    slope: Vec<f32>,
    /// The answer: disparity, standard deviation, and noise variance of the difference.
    refined: Vec<f32>,
    sigma: Vec<f32>,
    noise: Vec<f32>,
}

/// The median of the values that are numbers.
fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut sample: Vec<f32> = values.filter(|n| !n.is_nan()).collect();
    upper_median(&mut sample, f32::total_cmp)
}

/// The window's rows around row `v` of a plane with rows of `stride`, RADIUS.1 up and down; outside
/// the image there are none.
fn window_rows(plane: &[f32], stride: usize, v: usize) -> impl Iterator<Item = &[f32]> {
    let first = v.saturating_sub(RADIUS.1);
    plane.chunks_exact(stride).skip(first).take(v + RADIUS.1 + 1 - first)
}

impl Refinement {
    /// Refine `coarse` (row-major, NaN is missing).
    pub(super) fn refine(&mut self, left: &Image, right: &Image, coarse: &[f32]) {
        self.start(left.width(), left.height());
        let right = spline::row_coefficients(right);
        let stride = self.stride();
        let rows = self.refined.par_chunks_mut(stride).zip(coarse.par_chunks(self.width));
        rows.for_each(|(row, coarse)| row[RADIUS.0..][..coarse.len()].copy_from_slice(coarse));
        let mut offset = RowOffset::default();
        for step in 0..STEPS {
            self.smooth();
            if step == 0 {
                // All later steps start from here; what they compare at is written anew.
                std::mem::swap(&mut self.prior, &mut self.disparity);
            }
            self.compare(left, &right, step == 0, offset);
            if step == 0 {
                offset = self.row_offset(left);
            }
            let typical_noise = self.typical_noise();
            self.solve(typical_noise, step == 0);
        }
    }

    /// Row `v` of the answer: disparity and standard deviation, NaN is missing.
    pub(super) fn row(&self, v: usize) -> (&[f32], &[f32]) {
        let row = v * self.stride() + RADIUS.0..v * self.stride() + RADIUS.0 + self.width;
        (&self.refined[row.clone()], &self.sigma[row])
    }

    fn stride(&self) -> usize {
        row_length(self.width)
    }

    fn start(&mut self, width: usize, height: usize) {
        self.width = width;
        let size = self.stride() * height;
        let planes = [
            (&mut self.prior, f32::NAN),
            (&mut self.disparity, f32::NAN),
            (&mut self.along, f32::NAN),
            (&mut self.support, 0.0),
            (&mut self.weight, 0.0),
            (&mut self.difference, 0.0),
            (&mut self.slope, 0.0),
            (&mut self.refined, f32::NAN),
            (&mut self.sigma, f32::NAN),
            (&mut self.noise, f32::NAN),
        ];
        for (plane, missing) in planes {
            // Margins keep their value; everything else is written before it is read, but for noise.
            if plane.len() != size {
                plane.clear();
                plane.resize(size, missing);
            }
        }
        self.noise.fill(f32::NAN);
    }

    /// The disparity to compare at: the mean of each pixel's surface.
    fn smooth(&mut self) {
        const ACROSS: usize = 2 * RADIUS.0 + 1;
        const DOWN: usize = 2 * RADIUS.1 + 1;
        let (stride, width) = (self.stride(), self.width);
        let Self { along, refined, disparity, support, .. } = self;
        let rows = along.par_chunks_mut(stride).zip(support.par_chunks_mut(stride));
        rows.zip(refined.par_chunks(stride)).for_each(|((mean, support), row)| {
            let lines: [&[f32]; ACROSS] = std::array::from_fn(|k| &row[k..k + width]);
            let (centre, mean) = (&row[RADIUS.0..], &mut mean[RADIUS.0..RADIUS.0 + width]);
            let support = &mut support[RADIUS.0..RADIUS.0 + width];
            widest(SurfaceMean { lines, centre, mean, support, first: true });
        });
        let height = along.len() / stride;
        let rows = disparity.par_chunks_mut(stride).zip(support.par_chunks_mut(stride));
        rows.enumerate().for_each(|(v, (mean, support))| {
            // A row outside the image is no neighbour; the centre's own stands in and changes little.
            let row = |k: usize| match (v + k).checked_sub(RADIUS.1) {
                Some(v) if v < height => v,
                _ => v,
            };
            let lines: [&[f32]; DOWN] = std::array::from_fn(|k| &along[row(k) * stride..][..stride]);
            widest(SurfaceMean { lines, centre: lines[RADIUS.1], mean, support, first: false });
        });
    }

    /// Compare the left image with the right one (as row coefficients) read at the disparity of each pixel.
    fn compare(&mut self, left: &Image, right: &Image, first: bool, offset: RowOffset) {
        let (stride, width) = (self.stride(), self.width);
        let disparity = if first { &self.prior } else { &self.disparity };
        let planes = (disparity.par_chunks(stride))
            .zip(self.weight.par_chunks_mut(stride))
            .zip(self.slope.par_chunks_mut(stride))
            .zip(self.difference.par_chunks_mut(stride));
        planes.enumerate().for_each(|(v, (((disparity, weight), slope), difference))| {
            let inner = RADIUS.0..RADIUS.0 + width;
            let (above, below) = rows_beside(left, v);
            widest(CompareRow {
                left: left.row(v),
                above,
                below,
                row_offset: offset.along(v),
                right: right.row(v),
                disparity: &disparity[inner.clone()],
                weight: &mut weight[inner.clone()],
                slope: &mut slope[inner.clone()],
                difference: &mut difference[inner],
            });
        });
    }

    /// The disagreement of rows that the first comparison shows.
    fn row_offset(&self, left: &Image) -> RowOffset {
        let inner = RADIUS.0..RADIUS.0 + self.width;
        let rows = self.difference.par_chunks(self.stride()).zip(self.slope.par_chunks(self.stride()));
        RowOffset::fit(left, rows.map(|(e, g)| (&e[inner.clone()], &g[inner.clone()])))
    }

    /// Median over the image of the noise variance of the last step; `None` before the first.
    fn typical_noise(&self) -> Option<f32> {
        median(self.noise.iter().copied().step_by(NOISE_SAMPLING_PX))
    }

    /// Solve for the disparity of every window.
    fn solve(&mut self, typical_noise: Option<f32>, first: bool) {
        let (stride, width) = (self.stride(), self.width);
        let Self { prior, disparity, support, weight, difference, slope, refined, sigma, noise, .. } = self;
        let compared = if first { &*prior } else { &*disparity };
        let answers = refined.par_chunks_mut(stride).zip(sigma.par_chunks_mut(stride));
        answers.zip(noise.par_chunks_mut(stride)).enumerate().for_each_init(
            || (vec![0.0; width], vec![0.0; width]),
            |(pull, information), (v, ((refined, sigma), noise))| {
                let planes = window_rows(weight, stride, v)
                    .zip(window_rows(slope, stride, v))
                    .zip(window_rows(difference, stride, v));
                let rows: Vec<DifferenceRow<'_>> = planes
                    .map(|((weight, slope), difference)| DifferenceRow { weight, slope, difference })
                    .collect();
                let inner = RADIUS.0..RADIUS.0 + width;
                let correction = CorrectionRow { pull, information, noise: &mut noise[inner.clone()] };
                widest(SolveWindows { rows: &rows, typical_noise, correction });
                let row = v * stride + RADIUS.0..v * stride + RADIUS.0 + width;
                widest(Posterior {
                    prior: &prior[row.clone()],
                    compared: &compared[row.clone()],
                    support: &support[row],
                    pull,
                    information,
                    refined: &mut refined[inner.clone()],
                    sigma: &mut sigma[inner],
                });
            },
        );
    }
}

/// The mean over the pixels `lines[k][i]`, k = 0 …, that are of the surface of `centre[i]`.
///
/// Missing where the centre is (NaN); pixels that are missing do not count.
struct SurfaceMean<'a, const N: usize> {
    /// The middle one may be the centre's own line.
    lines: [&'a [f32]; N],
    centre: &'a [f32],
    mean: &'a mut [f32],
    /// Share of the pixels that are of the surface, 0 … 1: times what it was, unless `first`.
    support: &'a mut [f32],
    first: bool,
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
                let tolerance = SAME_SURFACE_PX.0 + SAME_SURFACE_PX.1 * k.abs_diff(N / 2) as f32;
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
