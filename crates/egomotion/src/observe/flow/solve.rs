//! The normal equations of each window.
//!
//! With g the gradient of the first image and r the difference after the displacement so far, the step
//! is −G⁻¹ Σ (g − ḡ) r, where G = Σ (g − ḡ)(g − ḡ)ᵀ over the weighted window: Lucas–Kanade with a free
//! brightness offset. The covariance is σ² G⁻¹ / n with σ² the window's variance of r after the step (at
//! least the floor) and n = (Σw)²/Σw² the number of pixels the weighted window is worth, enlarged by what
//! `variance_factor` finds neighbours to have in common.

use super::FlowOptions;
use super::compare::TILE;
use super::refine::SUMS;
use crate::observe::pyramid::GRADIENT_NOISE_GAIN;

/// Share of the window that must have a counterpart in the second image.
const MIN_COVERAGE: f32 = 0.6;
/// A step of the last iteration longer than this, in pixels, says that there is no convergence.
pub(super) const MAX_LAST_STEP_PX: f32 = 0.5;
/// No step is longer than this, in pixels: the images are linear over little more.
const MAX_STEP_PX: f32 = 1.0;

/// A row of answers. One that is unknown for want of texture has an infinite `uu`, one that is refuted
/// NaN; both have NaN for u and v.
#[derive(Debug, Clone)]
pub(super) struct Solved {
    width: usize,
    /// Displacement after the step, with its covariance, where both are to be believed.
    pub u: Vec<f32>,
    pub v: Vec<f32>,
    pub uu: Vec<f32>,
    pub uv: Vec<f32>,
    pub vv: Vec<f32>,
    /// Displacement after a damped step, everywhere: where the next iteration begins.
    pub moved_u: Vec<f32>,
    pub moved_v: Vec<f32>,
    /// Variance of r before and after the step, in squared grey levels; infinite where too little is seen.
    pub before: Vec<f32>,
    pub residual: Vec<f32>,
}

impl Solved {
    /// For rows of so many pixels.
    pub fn new(width: usize) -> Self {
        let row = || vec![0.0; width.next_multiple_of(TILE)];
        Self {
            width,
            u: row(),
            v: row(),
            uu: row(),
            uv: row(),
            vv: row(),
            moved_u: row(),
            moved_v: row(),
            before: row(),
            residual: row(),
        }
    }

    /// Pixels of the row.
    pub fn width(&self) -> usize {
        self.width
    }
}

/// What is the same for all windows; see [`FlowOptions`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Settings {
    area: f32,
    factor: f32,
    /// 1/σ² of the start, 0 if nothing is known.
    prior_information: f32,
    noise_variance: f32,
    floor_variance: f32,
    max_variance: f32,
    min_texture: f32,
    max_residual_variance: f32,
}

impl Settings {
    pub fn new(options: &FlowOptions, factor: f32, prior_sigma_px: f32) -> Self {
        let square = |x: f32| x * x;
        Self {
            area: options.correlation_area_px(),
            factor,
            prior_information: 1.0 / square(prior_sigma_px),
            noise_variance: square(options.noise_floor),
            floor_variance: square(options.sigma_floor_px),
            max_variance: square(options.max_sigma_px),
            min_texture: options.min_texture,
            max_residual_variance: square(options.max_residual),
        }
    }
}

/// The larger of two, without a thought for NaN.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// −(G + floor)⁻¹ b.
#[inline(always)]
fn step([guu, guv, gvv]: [f32; 3], floor: f32, [bu, bv]: [f32; 2]) -> [f32; 2] {
    let (uu, vv) = (guu + floor, gvv + floor);
    let per_det = -1.0 / (uu * vv - guv * guv);
    [(vv * bu - guv * bv) * per_det, (uu * bv - guv * bu) * per_det]
}

/// The answers of a tile that begins at pixel `first`, from the sums over its windows.
#[inline(always)]
pub(super) fn solve(
    sums: &[[f32; TILE]; SUMS],
    at: (&[f32], &[f32]),
    settings: &Settings,
    solved: &mut Solved,
    first: usize,
) {
    let here = first..first + TILE;
    let rows = [
        &mut solved.u[here.clone()],
        &mut solved.v[here.clone()],
        &mut solved.uu[here.clone()],
        &mut solved.uv[here.clone()],
        &mut solved.vv[here.clone()],
        &mut solved.moved_u[here.clone()],
        &mut solved.moved_v[here.clone()],
        &mut solved.before[here.clone()],
        &mut solved.residual[here],
    ];
    let [out_u, out_v, out_uu, out_uv, out_vv, moved_u, moved_v, out_before, out_residual] = rows;
    let (at_u, at_v) = (&at.0[..TILE], &at.1[..TILE]);
    let s = settings;
    for i in 0..TILE {
        let count = sums[0][i];
        let n = 1.0 / larger(count, 1e-6);
        let (gu, gv, r) = (sums[1][i] * n, sums[2][i] * n, sums[3][i] * n);
        let g = [sums[4][i] * n - gu * gu, sums[5][i] * n - gu * gv, sums[6][i] * n - gv * gv];
        let b = [sums[7][i] * n - gu * r, sums[8][i] * n - gv * r];
        let before = larger(sums[9][i] * n - r * r, 0.0);
        // Three unknowns (two components and the offset) have been fitted.
        let pixels = larger(count * s.area, 4.0);
        // A little of the noise on the diagonal keeps the step finite without texture.
        let floor = 0.05 * s.noise_variance;
        let [du, dv] = step(g, floor, b);
        let residual = larger(before + du * b[0] + dv * b[1], 0.0);
        let covered = count >= MIN_COVERAGE;
        out_before[i] = if covered { before } else { f32::INFINITY };
        out_residual[i] = if covered { residual } else { f32::INFINITY };

        let damping = larger(before, s.noise_variance) * s.prior_information / pixels;
        let [mu, mv] = step(g, larger(floor, damping), b);
        let longest = larger(mu.abs(), mv.abs());
        let shorter = if longest > MAX_STEP_PX { MAX_STEP_PX / longest } else { 1.0 };
        let usable = covered & (longest < f32::INFINITY);
        moved_u[i] = at_u[i] + if usable { shorter * mu } else { 0.0 };
        moved_v[i] = at_v[i] + if usable { shorter * mv } else { 0.0 };

        let variance = larger(residual * pixels / (pixels - 3.0), s.noise_variance);
        // The noise of one image, half of the difference's, makes gradients even where there are none.
        let noise = 0.5 * variance * GRADIENT_NOISE_GAIN;
        let (uu, uv, vv) = (g[0] - noise, g[1], g[2] - noise);
        let det = uu * vv - uv * uv;
        // G⁻¹ (G + noise) G⁻¹: the noise of the gradients multiplies that of the difference.
        let per_det = 1.0 / det;
        let scale = variance * s.factor * per_det / pixels;
        let [iuu, iuv, ivv] = [vv * per_det, -uv * per_det, uu * per_det];
        let cuu = scale * (vv + noise * (iuu * iuu + iuv * iuv) * det) + s.floor_variance;
        let cuv = scale * (-uv + noise * iuv * (iuu + ivv) * det);
        let cvv = scale * (uu + noise * (ivv * ivv + iuv * iuv) * det) + s.floor_variance;
        let least = 0.5 * (uu + vv - ((uu - vv) * (uu - vv) + 4.0 * uv * uv).sqrt());
        let (half, difference) = (0.5 * (cuu + cvv), 0.5 * (cuu - cvv));
        let largest = half + (difference * difference + cuv * cuv).sqrt();
        let textured = (least > s.min_texture * noise) & (largest <= s.max_variance);
        let matches = covered
            & (residual <= s.max_residual_variance)
            & (larger(du.abs(), dv.abs()) <= MAX_LAST_STEP_PX);
        let believed = textured & matches;
        out_u[i] = if believed { at_u[i] + du } else { f32::NAN };
        out_v[i] = if believed { at_v[i] + dv } else { f32::NAN };
        let without = if textured { f32::NAN } else { f32::INFINITY };
        out_uu[i] = if believed { cuu } else { without };
        out_uv[i] = if believed { cuv } else { without };
        out_vv[i] = if believed { cvv } else { without };
    }
}
