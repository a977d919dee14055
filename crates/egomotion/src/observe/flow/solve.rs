//! The normal equations of each window.
//!
//! With g the gradient of the first image and r the difference after the displacement so far, the step
//! is −G⁻¹ Σ (g − ḡ) r, where G = Σ (g − ḡ)(g − ḡ)ᵀ over the weighted window: Lucas–Kanade with a free
//! brightness offset. The covariance is σ² G⁻¹ / n with σ² the window's variance of r after the step (at
//! least the floor) and n = (Σw)²/Σw² the number of pixels the weighted window is worth, enlarged by what
//! `variance_factor` finds neighbours to have in common.

use super::FlowOptions;
use super::compare::TILE;
use super::step_planes::{FlowRows, REFUTED, TEXTURELESS, UNMEASURED, UNSEEN};
use crate::observe::pyramid::GRADIENT_NOISE_GAIN;

/// Number of weighted sums over a window; see [`WindowSums`].
pub(super) const SUMS: usize = 10;
/// Least share of the window that must have a counterpart in the second image.
const MIN_COVERAGE: f32 = 0.6;
/// A step of the last iteration longer than this, in pixels, says that there is no convergence.
const MAX_LAST_STEP_PX: f32 = 0.5;
/// No step is longer than this, in pixels: the images are linear over little more.
const MAX_STEP_PX: f32 = 1.0;
/// Share of the noise's variance on the diagonal of G: a little keeps the step finite without texture.
const DIAGONAL_NOISE: f32 = 0.05;
/// Unknowns that are fitted to a window: two components and the offset.
const UNKNOWNS: f32 = 3.0;
/// Least number of pixels that a window counts as, so that some remain beyond the unknowns.
const LEAST_PIXELS: f32 = 4.0;
/// Standard deviation of the difference of two grey levels when nothing is wrong, in grey levels of 8 bits: the least
/// value of what is estimated locally from the residual.
pub(super) const NOISE_FLOOR: f32 = 0.7;
/// Standard deviation added to each component for what the residual does not show (interpolation, aliasing), in pixels.
const SIGMA_FLOOR_PX: f32 = 0.035;

/// Weighted sums over the windows of N pixels, in this order: pixels with a counterpart; gradient (u, v) and difference
/// r; products uu, uv, vv of the gradient; products ur, vr with the difference; rr.
pub(super) type WindowSums<const N: usize> = [[f32; N]; SUMS];

/// A row of answers, each in a state that [`StepState`](super::step_planes::StepState) describes.
#[derive(Debug, Clone)]
pub(super) struct SolvedRow {
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
    /// Variance of r after the step and before it, in squared grey levels; [`UNSEEN`] where too little is seen.
    pub residual: Vec<f32>,
    pub residual_before: Vec<f32>,
}

impl SolvedRow {
    /// For rows of so many pixels.
    pub(super) fn new(width: usize) -> Self {
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
            residual: row(),
            residual_before: row(),
        }
    }

    /// Pixels of the row.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Copy displacement and covariance to a row of planes.
    pub(super) fn copy_flow_to(&self, out: &mut FlowRows<'_>) {
        out.u.copy_from_slice(&self.u[..self.width]);
        out.v.copy_from_slice(&self.v[..self.width]);
        out.uu.copy_from_slice(&self.uu[..self.width]);
        out.uv.copy_from_slice(&self.uv[..self.width]);
        out.vv.copy_from_slice(&self.vv[..self.width]);
    }
}

/// What is the same for all windows; see [`FlowOptions`].
#[derive(Debug, Clone, Copy)]
pub(super) struct StepSettings {
    /// Pixels that a window with all its counterparts is worth.
    area: f32,
    /// By how much neighbours' common noise enlarges the variance.
    variance_factor: f32,
    /// 1/σ² of the start, 0 if nothing is known.
    prior_information: f32,
    noise_variance: f32,
    floor_variance: f32,
    max_variance: f32,
    min_texture: f32,
    max_residual_variance: f32,
}

impl StepSettings {
    pub(super) fn new(options: &FlowOptions, variance_factor: f32, prior_sigma_px: f32) -> Self {
        let square = |x: f32| x * x;
        Self {
            area: options.correlation_area_px(),
            variance_factor,
            prior_information: 1.0 / square(prior_sigma_px),
            noise_variance: square(NOISE_FLOOR),
            floor_variance: square(SIGMA_FLOOR_PX),
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

/// The normal equations of one window, per pixel of its weight.
#[derive(Clone, Copy)]
struct NormalEquations {
    /// G: uu, uv, vv.
    g: [f32; 3],
    /// Σ (g − ḡ) r: u, v.
    b: [f32; 2],
    /// Variance of r before the step.
    before: f32,
    /// Pixels that the window is worth.
    pixels: f32,
}

/// The step damped by the prior of the start and no longer than [`MAX_STEP_PX`]; none where too little is seen.
#[inline(always)]
fn damped_step(equations: &NormalEquations, floor: f32, covered: bool, s: &StepSettings) -> [f32; 2] {
    let NormalEquations { g, b, before, pixels } = *equations;
    let damping = larger(before, s.noise_variance) * s.prior_information / pixels;
    let [mu, mv] = step(g, larger(floor, damping), b);
    let longest = larger(mu.abs(), mv.abs());
    let shorter = if longest > MAX_STEP_PX { MAX_STEP_PX / longest } else { 1.0 };
    let usable = covered & (longest < f32::INFINITY);
    [mu, mv].map(|component| if usable { shorter * component } else { 0.0 })
}

/// Covariance of a step, and whether there is enough texture for it.
struct StepCovariance {
    uu: f32,
    uv: f32,
    vv: f32,
    textured: bool,
}

impl StepCovariance {
    /// From the equations and the variance of r after the step.
    #[inline(always)]
    fn new(equations: &NormalEquations, residual: f32, s: &StepSettings) -> Self {
        let NormalEquations { g, pixels, .. } = *equations;
        let variance = larger(residual * pixels / (pixels - UNKNOWNS), s.noise_variance);
        // The noise of one image, half of the difference's, makes gradients even where there are none.
        let noise = 0.5 * variance * GRADIENT_NOISE_GAIN;
        let (uu, uv, vv) = (g[0] - noise, g[1], g[2] - noise);
        let det = uu * vv - uv * uv;
        // G⁻¹ (G + noise) G⁻¹: the noise of the gradients multiplies that of the difference.
        let per_det = 1.0 / det;
        let scale = variance * s.variance_factor * per_det / pixels;
        let [iuu, iuv, ivv] = [vv * per_det, -uv * per_det, uu * per_det];
        let cuu = scale * (vv + noise * (iuu * iuu + iuv * iuv) * det) + s.floor_variance;
        let cuv = scale * (-uv + noise * iuv * (iuu + ivv) * det);
        let cvv = scale * (uu + noise * (ivv * ivv + iuv * iuv) * det) + s.floor_variance;
        let least = 0.5 * (uu + vv - ((uu - vv) * (uu - vv) + 4.0 * uv * uv).sqrt());
        let (half, difference) = (0.5 * (cuu + cvv), 0.5 * (cuu - cvv));
        let largest = half + (difference * difference + cuv * cuv).sqrt();
        let textured = (least > s.min_texture * noise) & (largest <= s.max_variance);
        Self { uu: cuu, uv: cuv, vv: cvv, textured }
    }
}

/// The answers of a tile that begins at pixel `first`, from the sums over its windows.
#[inline(always)]
pub(super) fn solve(
    sums: &WindowSums<TILE>,
    at: (&[f32], &[f32]),
    settings: &StepSettings,
    solved: &mut SolvedRow,
    first: usize,
) {
    let here = first..first + TILE;
    let out_u = &mut solved.u[here.clone()];
    let out_v = &mut solved.v[here.clone()];
    let out_uu = &mut solved.uu[here.clone()];
    let out_uv = &mut solved.uv[here.clone()];
    let out_vv = &mut solved.vv[here.clone()];
    let moved_u = &mut solved.moved_u[here.clone()];
    let moved_v = &mut solved.moved_v[here.clone()];
    let out_before = &mut solved.residual_before[here.clone()];
    let out_residual = &mut solved.residual[here];
    let (at_u, at_v) = (&at.0[..TILE], &at.1[..TILE]);
    let [counts, us, vs, rs, uus, uvs, vvs, urs, vrs, rrs] = sums;
    let s = settings;
    for i in 0..TILE {
        let count = counts[i];
        let n = 1.0 / larger(count, 1e-6);
        let (gu, gv, r) = (us[i] * n, vs[i] * n, rs[i] * n);
        let g = [uus[i] * n - gu * gu, uvs[i] * n - gu * gv, vvs[i] * n - gv * gv];
        let b = [urs[i] * n - gu * r, vrs[i] * n - gv * r];
        let before = larger(rrs[i] * n - r * r, 0.0);
        let pixels = larger(count * s.area, LEAST_PIXELS);
        let equations = NormalEquations { g, b, before, pixels };
        let floor = DIAGONAL_NOISE * s.noise_variance;
        let [du, dv] = step(g, floor, b);
        let residual = larger(before + du * b[0] + dv * b[1], 0.0);
        let covered = count >= MIN_COVERAGE;
        out_before[i] = if covered { before } else { UNSEEN };
        out_residual[i] = if covered { residual } else { UNSEEN };

        let [mu, mv] = damped_step(&equations, floor, covered, s);
        moved_u[i] = at_u[i] + mu;
        moved_v[i] = at_v[i] + mv;

        let cov = StepCovariance::new(&equations, residual, s);
        let matches = covered
            & (residual <= s.max_residual_variance)
            & (larger(du.abs(), dv.abs()) <= MAX_LAST_STEP_PX);
        let believed = cov.textured & matches;
        out_u[i] = if believed { at_u[i] + du } else { UNMEASURED };
        out_v[i] = if believed { at_v[i] + dv } else { UNMEASURED };
        let without = if cov.textured { REFUTED } else { TEXTURELESS };
        out_uu[i] = if believed { cov.uu } else { without };
        out_uv[i] = if believed { cov.uv } else { without };
        out_vv[i] = if believed { cov.vv } else { without };
    }
}
