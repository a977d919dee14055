//! The least-squares step of one window: how far the grey levels move its disparity, and how surely, and what
//! follows with the semi-global disparity as a prior.
//!
//! B. Lucas, T. Kanade, IJCAI 1981, in one dimension. The variance of the step is that of the grey
//! levels' difference, taken from the residual, over the sum of the squared slopes.

use crate::simd::{Bytes, Kernel};

/// Half width and half height of the windows, in pixels: larger ones are surer and blur more of the surface.
pub(super) const RADIUS: (usize, usize) = (4, 3);
/// Weight of the whole image's noise against a window's own, in pixels of the window.
const NOISE_PRIOR_PIXELS: f32 = 8.0;
/// Fewest pixels of a window that say anything of its disparity.
const FEWEST_PIXELS: f32 = 6.0;
/// Least noise variance against the variance of the slopes: what f32 sums can tell from nothing.
const LEAST_NOISE: f32 = 1e-6;
/// Columns solved at a time: what they need stays in the fastest cache.
const TILE: usize = 128;
/// Columns of a tile's windows.
const TILE_COLUMNS: usize = TILE + 2 * RADIUS.0;
/// Sums of a window: number of pixels n, slopes g, differences e, and their products gg, ge, ee.
const SUMS: usize = 6;
/// Standard deviation of the semi-global disparity, in pixels.
const PRIOR_SIGMA_PX: f32 = 0.4;
/// Standard deviation where the refinement contradicts the semi-global disparity, in pixels.
const CONTRADICTED_SIGMA_PX: f32 = 1.0;
/// Correction of the semi-global disparity beyond which it counts as contradicted, in pixels.
const CONTRADICTION_PX: f32 = 1.0;
/// Standard deviation that no image noise explains (interpolation), in pixels.
const MODEL_SIGMA_PX: f32 = 0.02;
/// Variance, in squares of the last step, for the depth inside a window that no one step fits;
/// measured on Middlebury pairs.
const MISFIT_WEIGHT: f32 = 1.0;
/// Growth of the variance that residuals do not show: neighbours are compared at disparities smoothed
/// together, and err together. Measured on rendered, Middlebury and KITTI pairs alike.
const SHARED_ERROR: f32 = 1.4;
/// Growth of the standard deviation where the window is not all of one surface, beside edges and
/// holes; measured on Middlebury and KITTI pairs.
const STRAY_WEIGHT: f32 = 4.0;

/// A row of weights, slopes and differences of grey levels, from RADIUS.0 pixels left of the image
/// on, in `row_length` pixels.
#[derive(Clone, Copy)]
pub(super) struct DifferenceRow<'a> {
    /// 1 where a difference is known, else 0 like the others.
    pub weight: &'a [f32],
    /// Derivative of the difference by the disparity.
    pub slope: &'a [f32],
    /// Left minus right grey level.
    pub difference: &'a [f32],
}

/// What the grey levels of the windows of a row say of their disparity.
pub(super) struct CorrectionRow<'a> {
    /// Correction of the disparity, in pixels, times `information`.
    pub pull: &'a mut [f32],
    /// Inverse variance of the correction, px⁻².
    pub information: &'a mut [f32],
    /// Noise variance of the difference of two grey levels; NaN if the window has too few pixels.
    pub noise: &'a mut [f32],
}

/// Pixels of a row with the margins that windows need.
pub(super) fn row_length(width: usize) -> usize {
    width.next_multiple_of(TILE) + 2 * RADIUS.0
}

/// Least squares of e = offset − g δ over each window of a row, whose offset takes up a difference
/// of brightness.
pub(super) struct SolveWindows<'a, 'b> {
    /// The rows of the window.
    pub rows: &'b [DifferenceRow<'a>],
    /// Median noise of the image.
    pub typical_noise: Option<f32>,
    pub correction: CorrectionRow<'b>,
}

impl Kernel for SolveWindows<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let Self { rows, typical_noise, correction } = self;
        let tiles = (correction.pull.chunks_mut(TILE))
            .zip(correction.information.chunks_mut(TILE))
            .zip(correction.noise.chunks_mut(TILE));
        for (tile, ((pull, information), noise)) in tiles.enumerate() {
            let sums = across(&down(rows, tile * TILE));
            solve(&sums, typical_noise, pull, information, noise);
        }
    }
}

/// Sums over the rows, of the columns from `first` on.
#[inline(always)]
fn down<'a>(rows: &[DifferenceRow<'a>], first: usize) -> [[f32; TILE_COLUMNS]; SUMS] {
    let mut sums = [[0.0; TILE_COLUMNS]; SUMS];
    let [n, g, e, gg, ge, ee] = &mut sums;
    for row in rows {
        let piece = |line: &'a [f32]| line[first..].first_chunk::<TILE_COLUMNS>();
        let pieces = (piece(row.weight), piece(row.slope), piece(row.difference));
        let (Some(w), Some(s), Some(d)) = pieces else { continue };
        for i in 0..TILE_COLUMNS {
            n[i] += w[i];
            g[i] += s[i];
            e[i] += d[i];
            gg[i] += s[i] * s[i];
            ge[i] += s[i] * d[i];
            ee[i] += d[i] * d[i];
        }
    }
    sums
}

/// Sums over the nine columns from each on.
#[inline(always)]
fn across(columns: &[[f32; TILE_COLUMNS]; SUMS]) -> [[f32; TILE]; SUMS] {
    const { assert!(RADIUS.0 == 4) };
    let mut sums = [[0.0; TILE]; SUMS];
    for (sum, line) in sums.iter_mut().zip(columns) {
        let mut three = [0.0; TILE + 6];
        for i in 0..TILE + 6 {
            three[i] = line[i] + line[i + 1] + line[i + 2];
        }
        for i in 0..TILE {
            sum[i] = three[i] + three[i + 3] + three[i + 6];
        }
    }
    sums
}

/// The least squares of each window.
#[inline(always)]
fn solve(
    sums: &[[f32; TILE]; SUMS],
    typical_noise: Option<f32>,
    pull: &mut [f32],
    information: &mut [f32],
    noise: &mut [f32],
) {
    let (prior_pixels, prior_noise) = match typical_noise {
        Some(typical) => (NOISE_PRIOR_PIXELS, NOISE_PRIOR_PIXELS * typical),
        None => (0.0, 0.0),
    };
    let mut answers = [[0.0; TILE]; 3];
    let [pulls, informations, noises] = &mut answers;
    let [n, g, e, gg, ge, ee] = sums;
    for i in 0..TILE {
        let n = n[i];
        let per_pixel = 1.0 / if n > 1.0 { n } else { 1.0 };
        let positive = |x: f32| if x > 0.0 { x } else { 0.0 };
        let gg = positive(gg[i] - g[i] * g[i] * per_pixel);
        let ge = ge[i] - g[i] * e[i] * per_pixel;
        let ee = positive(ee[i] - e[i] * e[i] * per_pixel);
        let per_gg = if gg > 0.0 { 1.0 / gg } else { 0.0 };
        let residual = positive(ee - ge * ge * per_gg);
        let degrees = if n > 3.0 { n - 2.0 } else { 1.0 };
        let least = LEAST_NOISE * gg * per_pixel;
        let mean = (residual + prior_noise) / (degrees + prior_pixels);
        let noise = if mean > least { mean } else { least };
        // Noise makes slopes of its own, ¼ of the variance of the difference: they are no texture.
        let texture = positive(gg - 0.25 * n * noise);
        let enough = n >= FEWEST_PIXELS;
        let scale = if enough && texture > 0.0 { texture * per_gg / noise } else { 0.0 };
        pulls[i] = -ge * scale;
        informations[i] = gg * scale;
        noises[i] = if enough { residual / degrees } else { f32::NAN };
    }
    let count = pull.len();
    pull.copy_from_slice(&pulls[..count]);
    information.copy_from_slice(&informations[..count]);
    noise.copy_from_slice(&noises[..count]);
}

/// Disparity and its standard deviation from the semi-global disparity and what the grey levels say
/// at `compared`; NaN where there is no semi-global disparity.
pub(super) struct Posterior<'a> {
    pub prior: &'a [f32],
    pub compared: &'a [f32],
    /// Share of the window that is of the pixel's surface.
    pub support: &'a [f32],
    pub pull: &'a [f32],
    pub information: &'a [f32],
    pub refined: &'a mut [f32],
    pub sigma: &'a mut [f32],
}

impl Kernel for Posterior<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let n = self.refined.len();
        let (prior, compared) = (&self.prior[..n], &self.compared[..n]);
        let (pull, information, support) = (&self.pull[..n], &self.information[..n], &self.support[..n]);
        let (refined, sigma) = (&mut self.refined[..n], &mut self.sigma[..n]);
        let prior_information = PRIOR_SIGMA_PX.powi(-2);
        for i in 0..n {
            let information = information[i] + prior_information;
            let value = compared[i] + (pull[i] + prior_information * (prior[i] - compared[i])) / information;
            // A surface on which the window's pixels do not agree still moves in the last step.
            let misfit = MISFIT_WEIGHT * (value - compared[i]) * (value - compared[i]);
            let spread = (SHARED_ERROR / information + misfit + MODEL_SIGMA_PX * MODEL_SIGMA_PX).sqrt();
            let contradicts = (value - prior[i]).abs() > CONTRADICTION_PX;
            let (value, spread) =
                if contradicts { (prior[i], CONTRADICTED_SIGMA_PX) } else { (value, spread) };
            let strays = 1.0 + STRAY_WEIGHT * (1.0 - support[i]);
            // Where no window can be compared the semi-global disparity remains.
            let known = information.abs() < f32::INFINITY && !value.is_nan();
            let unknown = if prior[i].is_nan() { f32::NAN } else { PRIOR_SIGMA_PX };
            refined[i] = if known { value } else { prior[i] };
            sigma[i] = strays * if known { spread } else { unknown };
        }
    }
}
