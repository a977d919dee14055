//! Sub-pixel disparity with its standard deviation: photometric refinement along the row.
//!
//! One Gauss–Newton step of B. Lucas and T. Kanade, "An iterative image registration technique with
//! an application to stereo vision", IJCAI 1981, repeated. Each pixel of the window is compared at
//! its *own* disparity, so the window follows slanted and curved surfaces, and beyond a depth edge
//! a pixel asks for its own correction, which is as small as that of the window's centre. The
//! disparity of the semi-global matching enters as a prior, which alone remains where there is no
//! texture.

use rayon::prelude::*;

use super::check::NO_LEVEL;
use super::lanes::{Bytes, Kernel, widest};
use super::lucas_kanade::{Differences, Fit, FitRow, row_length};
use super::rows::{RowOffset, beside};
use super::surface::{RADIUS, SurfaceMean};
use crate::geometry::{Image, upper_median};
use crate::observe::spline;

/// Standard deviation of the semi-global disparity, in pixels.
const PRIOR_SIGMA: f32 = 0.4;
/// Standard deviation where the refinement contradicts the semi-global disparity, in pixels.
const CONTRADICTED_SIGMA: f32 = 1.0;
/// Correction of the semi-global disparity beyond which it counts as contradicted, in pixels.
const CONTRADICTION: f32 = 1.0;
/// What no image noise explains (interpolation), in pixels.
const MODEL_SIGMA: f32 = 0.02;
/// Variance, in squares of the last step, for the depth inside a window that no one step fits;
/// measured on Middlebury pairs.
const MISFIT_WEIGHT: f32 = 1.0;
/// Growth of the variance that residuals do not show: neighbours are compared at disparities smoothed
/// together, and err together. Measured on rendered, Middlebury and KITTI pairs alike.
const SHARED_ERROR: f32 = 1.4;
/// Growth of the standard deviation where the window is not all of one surface, beside edges and
/// holes; measured on Middlebury and KITTI pairs.
const STRAY_WEIGHT: f32 = 4.0;

/// Offset of the minimum of the parabola through three neighbouring costs, −½ … ½; 0 beside the
/// end of the levels and where there is no minimum.
pub(super) fn parabola(costs: [u16; 3]) -> f32 {
    let [before, here, after] = costs.map(f32::from);
    let curvature = before - 2.0 * here + after;
    let beside_end = costs[0].max(costs[2]) == NO_LEVEL;
    if curvature > 0.0 && !beside_end { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

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

/// Every how many pixels the median over an image is taken of.
const SAMPLING: usize = 61;

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
    /// Refine `coarse` (row-major, NaN is missing) by `steps` steps.
    pub(super) fn refine(&mut self, left: &Image, right: &Image, coarse: &[f32], steps: usize) {
        self.start(left.width(), left.height());
        let right = spline::row_coefficients(right);
        let stride = self.stride();
        let rows = self.refined.par_chunks_mut(stride).zip(coarse.par_chunks(self.width));
        rows.for_each(|(row, coarse)| row[RADIUS.0..][..coarse.len()].copy_from_slice(coarse));
        let mut offset = RowOffset::default();
        for step in 0..steps {
            self.smooth();
            if step == 0 {
                // All later steps start from here; what they compare at is written anew.
                std::mem::swap(&mut self.prior, &mut self.disparity);
            }
            self.compare(left, &right, step == 0, offset);
            if step == 0 && steps > 1 {
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
            let (above, below) = beside(left, v);
            widest(Compare {
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
        median(self.noise.iter().copied().step_by(SAMPLING))
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
                let rows: Vec<Differences<'_>> = planes
                    .map(|((weight, slope), difference)| Differences { weight, slope, difference })
                    .collect();
                let inner = RADIUS.0..RADIUS.0 + width;
                let fit = Fit { pull, information, noise: &mut noise[inner.clone()] };
                widest(FitRow { rows: &rows, typical_noise, fit });
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

/// A row of the left image against the right one, each pixel at its disparity.
struct Compare<'a> {
    left: &'a [f32],
    /// The left image's rows above and below.
    above: &'a [f32],
    below: &'a [f32],
    /// Right row minus left row at the first pixel, and its growth from pixel to pixel.
    row_offset: (f32, f32),
    /// Spline coefficients.
    right: &'a [f32],
    disparity: &'a [f32],
    weight: &'a mut [f32],
    slope: &'a mut [f32],
    difference: &'a mut [f32],
}

impl Kernel for Compare<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let Self { left, above, below, row_offset, right, disparity, weight, slope, difference } = self;
        let width = left.len();
        if width < 4 {
            [weight, slope, difference].into_iter().for_each(|line| line.fill(0.0));
            return;
        }
        for first in (0..width).step_by(TILE) {
            let here = first..(first + TILE).min(width);
            let mut tile = Tile::new(first, left, &disparity[here.clone()]);
            tile.split(width);
            for (i, &from) in tile.from.iter().enumerate() {
                let Some(taps) = right.get(from as usize..from as usize + 4) else { continue };
                for (line, &tap) in tile.taps.iter_mut().zip(taps) {
                    line[i] = tap;
                }
            }
            let mut lines = tile.compare(width);
            let mut down = [0.0; TILE];
            for (down, (above, below)) in
                down.iter_mut().zip(above[here.clone()].iter().zip(&below[here.clone()]))
            {
                *down = 0.5 * (below - above);
            }
            // What is seen of another row: it has no part in disparity.
            let [weight_here, _, difference_here] = &mut lines;
            for i in 0..TILE {
                let rows = row_offset.0 + row_offset.1 * (first + i) as f32;
                difference_here[i] -= weight_here[i] * rows * down[i];
            }
            let outputs = [&mut weight[here.clone()], &mut slope[here.clone()], &mut difference[here]];
            for (output, line) in outputs.into_iter().zip(&lines) {
                output.copy_from_slice(&line[..output.len()]);
            }
        }
        // The first and the last pixel have no slope.
        for u in [0, width - 1] {
            (weight[u], slope[u], difference[u]) = (0.0, 0.0, 0.0);
        }
    }
}

/// Pixels compared at a time.
const TILE: usize = 64;

/// Some pixels of the left row, and what the right row has for them.
struct Tile {
    /// Grey levels from one pixel before the first to one after the last.
    left: [f32; TILE + 2],
    /// Where in the right row each pixel is looked for.
    at: [f32; TILE],
    /// The first of the four coefficients around, and how far `at` is beyond the second.
    from: [u32; TILE],
    fraction: [f32; TILE],
    taps: [[f32; TILE]; 4],
}

impl Tile {
    #[inline(always)]
    fn new(first: usize, left: &[f32], disparity: &[f32]) -> Self {
        let mut tile = Self {
            left: [0.0; TILE + 2],
            at: [f32::NAN; TILE],
            from: [0; TILE],
            fraction: [0.0; TILE],
            taps: [[0.0; TILE]; 4],
        };
        let start = first.saturating_sub(1);
        let grey = &left[start..(first + TILE + 1).min(left.len())];
        let offset = start + 1 - first;
        tile.left[offset..offset + grey.len()].copy_from_slice(grey);
        for (i, (at, d)) in tile.at.iter_mut().zip(disparity).enumerate() {
            *at = (first + i) as f32 - d;
        }
        tile
    }

    /// Whole pixel and fraction of each place inside; anything elsewhere.
    #[inline(always)]
    fn split(&mut self, width: usize) {
        // Added to less than 2²³ this leaves the whole number in the last bits: a few operations on
        // vectors, where a checked conversion takes many.
        const LAST_BIT_IS_ONE: f32 = 8_388_608.0;
        let last = width as f32 - 3.0;
        for i in 0..TILE {
            let at = self.at[i];
            let inside = if at >= 1.0 { at } else { 1.0 };
            let inside = if inside <= last { inside } else { last };
            let whole = inside - 0.5 + LAST_BIT_IS_ONE;
            self.from[i] = (whole.to_bits() & 0x7f_ffff).saturating_sub(1);
            self.fraction[i] = inside - (whole - LAST_BIT_IS_ONE);
        }
    }

    /// Weight, slope and difference of each pixel.
    #[inline(always)]
    fn compare(&self, width: usize) -> [[f32; TILE]; 3] {
        let mut lines = [[0.0; TILE]; 3];
        let [weight, slope, difference] = &mut lines;
        let [a, b, c, d] = &self.taps;
        let end = width as f32 - 2.0;
        for i in 0..TILE {
            let at = self.at[i];
            // Of NaN this is false.
            let inside = at >= 1.0 && at < end;
            let w = spline::weights(self.fraction[i]);
            let grey = w[0] * a[i] + w[1] * b[i] + w[2] * c[i] + w[3] * d[i];
            weight[i] = if inside { 1.0 } else { 0.0 };
            // The right image's own slope would carry the noise of the grey level read there, and
            // pull every answer towards half pixels.
            slope[i] = if inside { 0.5 * (self.left[i + 2] - self.left[i]) } else { 0.0 };
            difference[i] = if inside { self.left[i + 1] - grey } else { 0.0 };
        }
        lines
    }
}

/// Disparity and its standard deviation from the semi-global disparity and what the grey levels say
/// at `compared`; NaN where there is no semi-global disparity.
struct Posterior<'a> {
    prior: &'a [f32],
    compared: &'a [f32],
    /// Share of the window that is of the pixel's surface.
    support: &'a [f32],
    pull: &'a [f32],
    information: &'a [f32],
    refined: &'a mut [f32],
    sigma: &'a mut [f32],
}

impl Kernel for Posterior<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let n = self.refined.len();
        let (prior, compared) = (&self.prior[..n], &self.compared[..n]);
        let (pull, information, support) = (&self.pull[..n], &self.information[..n], &self.support[..n]);
        let (refined, sigma) = (&mut self.refined[..n], &mut self.sigma[..n]);
        let prior_information = PRIOR_SIGMA.powi(-2);
        for i in 0..n {
            let information = information[i] + prior_information;
            let value = compared[i] + (pull[i] + prior_information * (prior[i] - compared[i])) / information;
            // A surface on which the window's pixels do not agree still moves in the last step.
            let misfit = MISFIT_WEIGHT * (value - compared[i]) * (value - compared[i]);
            let spread = (SHARED_ERROR / information + misfit + MODEL_SIGMA * MODEL_SIGMA).sqrt();
            let contradicts = (value - prior[i]).abs() > CONTRADICTION;
            let (value, spread) = if contradicts { (prior[i], CONTRADICTED_SIGMA) } else { (value, spread) };
            let strays = 1.0 + STRAY_WEIGHT * (1.0 - support[i]);
            // Where no window can be compared the semi-global disparity remains.
            let known = information.abs() < f32::INFINITY && !value.is_nan();
            let unknown = if prior[i].is_nan() { f32::NAN } else { PRIOR_SIGMA };
            refined[i] = if known { value } else { prior[i] };
            sigma[i] = strays * if known { spread } else { unknown };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parabola_finds_its_minimum() {
        let costs = [1.0, 0.0, -1.0].map(|d: f64| (1000.0 * (d + 0.3).powi(2)) as u16);
        assert!((parabola(costs) - 0.3).abs() < 1e-3);
        assert_eq!((parabola([7, 7, 7]), parabola([NO_LEVEL, 3, 9])), (0.0, 0.0));
    }
}
