//! Lucas–Kanade at full resolution: sub-pixel accuracy, and the covariance.

use super::correlation::variance_factor;
use super::smooth::smooth;
use super::window::{Rows, window_sums};
use super::{Answer, Displacement, FlowOptions};
use crate::geometry::{Grid, Image};
use crate::observe::pyramid::{GRADIENT_NOISE_GAIN, Gradients, gradients};
use crate::observe::spline;

/// Share of the window that must have a counterpart in the second image.
const MIN_COVERAGE: f32 = 0.6;
/// A step of the last iteration longer than this, in pixels, says that there is no convergence.
const MAX_LAST_STEP_PX: f32 = 0.5;
/// No step is longer than this, in pixels: the images are linear over little more.
const MAX_STEP_PX: f32 = 1.0;

/// What is summed over the window: count, g, r, g gᵀ, g r, r².
const SUMS: usize = 10;

/// Refine a displacement at every pixel of a pyramid's level (everything in pixels of that level), and
/// give its covariance.
///
/// With g the gradient of `from` and r the difference after the (smoothed) displacement so far, the step
/// is −G⁻¹ Σ (g − ḡ) r, where G = Σ (g − ḡ)(g − ḡ)ᵀ over the weighted window: Lucas–Kanade with a free
/// brightness offset. The covariance is σ² G⁻¹ / n with σ² the window's variance of r after the step (at
/// least the floor) and n = (Σw)²/Σw² the number of pixels the weighted window is worth, enlarged by what
/// [`variance_factor`] finds neighbours to have in common.
pub(super) fn refine(from: &Image, to: &Image, start: Displacement, options: &FlowOptions) -> Grid<Answer> {
    let (width, height) = from.size();
    let slopes = gradients(from);
    let to = &spline::coefficients(to);
    let weights = options.window_weights();
    let area = options.correlation_area_px();
    let mut answers = Grid::filled(width, height, Answer::UNKNOWN);
    let mut flow = start;
    for iteration in 1..=options.refine_iterations {
        let before = smooth(&flow);
        let is_last = iteration == options.refine_iterations;
        let factor = if is_last { variance_factor(from, to, &slopes, &before) } else { 1.0 };
        window_sums::<SUMS, Answer>(
            (width, height),
            &weights,
            answers.values_mut(),
            |y, rows| products(from, to, &slopes, &before, y, rows),
            |y, sums, out| {
                for (x, answer) in out.iter_mut().enumerate() {
                    let at = (before.u.at(x, y), before.v.at(x, y));
                    let window = Window::new(std::array::from_fn(|i| sums[i][x]), area, options.noise_floor);
                    *answer = if is_last { window.answer(at, factor, options) } else { window.step_from(at) };
                }
            },
        );
        if !is_last {
            for ((u, v), a) in flow.u.values_mut().iter_mut().zip(flow.v.values_mut()).zip(answers.values()) {
                (*u, *v) = (a.u, a.v);
            }
        }
    }
    answers
}

/// Write what is to be summed of row `y`; zeros where the displacement leaves the second image.
fn products(
    from: &Image,
    to: &Image,
    slopes: &Gradients,
    flow: &Displacement,
    y: usize,
    rows: &mut Rows<SUMS>,
) {
    let [count, gu, gv, r, guu, guv, gvv, gur, gvr, rr] = rows;
    let (grey, du, dv) = (from.row(y), slopes.du.row(y), slopes.dv.row(y));
    let (u, v) = (flow.u.row(y), flow.v.row(y));
    for x in 0..grey.len() {
        let moved = spline::sample(to, x as f32 + u[x], y as f32 + v[x]);
        let known = if moved.is_some() { 1.0 } else { 0.0 };
        count[x] = known;
        gu[x] = known * du[x];
        gv[x] = known * dv[x];
        r[x] = moved.map_or(0.0, |m| m - grey[x]);
    }
    for x in 0..grey.len() {
        let (a, b, c) = (gu[x], gv[x], r[x]);
        guu[x] = a * a;
        guv[x] = a * b;
        gvv[x] = b * b;
        gur[x] = a * c;
        gvr[x] = b * c;
        rr[x] = c * c;
    }
}

/// The normal equations of one window, per pixel of it: G, Σ g r, Σ r², all about their means.
struct Window {
    coverage: f32,
    /// Number of pixels the weighted window is worth.
    pixels: f32,
    g: [f32; 3],
    step: [f32; 2],
    /// Variance of r after the step.
    residual: f32,
}

impl Window {
    fn new([count, gu, gv, r, guu, guv, gvv, gur, gvr, rr]: [f32; SUMS], area: f32, noise: f32) -> Self {
        let n = 1.0 / count.max(1e-6);
        let (gu, gv, r) = (gu * n, gv * n, r * n);
        let g = [guu * n - gu * gu, guv * n - gu * gv, gvv * n - gv * gv];
        let b = [gur * n - gu * r, gvr * n - gv * r];
        // A little of the noise on the diagonal keeps the step finite without texture.
        let floor = 0.05 * noise * noise;
        let (uu, vv) = (g[0] + floor, g[2] + floor);
        let det = uu * vv - g[1] * g[1];
        let step = [-(vv * b[0] - g[1] * b[1]) / det, -(uu * b[1] - g[1] * b[0]) / det];
        let residual = (rr * n - r * r + step[0] * b[0] + step[1] * b[1]).max(0.0);
        Self { coverage: count, pixels: count * area, g, step, residual }
    }

    /// The displacement after this step.
    fn step_from(&self, (u, v): (f32, f32)) -> Answer {
        let longest = self.step[0].abs().max(self.step[1].abs());
        let scale = if longest > MAX_STEP_PX { MAX_STEP_PX / longest } else { 1.0 };
        if self.coverage < MIN_COVERAGE || !longest.is_finite() {
            return Answer { u, v, cov: [f32::NAN; 3] };
        }
        Answer { u: u + scale * self.step[0], v: v + scale * self.step[1], cov: [f32::NAN; 3] }
    }

    /// The displacement after this last step with its covariance, or nothing if it cannot be trusted.
    fn answer(&self, (u, v): (f32, f32), factor: f32, options: &FlowOptions) -> Answer {
        // Three unknowns (two components and the offset) have been fitted.
        let pixels = self.pixels.max(4.0);
        let floor = options.noise_floor * options.noise_floor;
        let variance = (self.residual * pixels / (pixels - 3.0)).max(floor);
        // The noise of one image, half of the difference's, makes gradients even where there are none.
        let noise = 0.5 * variance * GRADIENT_NOISE_GAIN;
        let (uu, uv, vv) = (self.g[0] - noise, self.g[1], self.g[2] - noise);
        let det = uu * vv - uv * uv;
        // G⁻¹ (G + noise) G⁻¹: the noise of the gradients multiplies that of the difference.
        let scale = variance * factor / (pixels * det);
        let [iuu, iuv, ivv] = [vv / det, -uv / det, uu / det];
        let extra = options.sigma_floor_px * options.sigma_floor_px;
        let cov = [
            scale * (vv + noise * (iuu * iuu + iuv * iuv) * det) + extra,
            scale * (-uv + noise * iuv * (iuu + ivv) * det),
            scale * (uu + noise * (ivv * ivv + iuv * iuv) * det) + extra,
        ];
        let least = 0.5 * (uu + vv - ((uu - vv) * (uu - vv) + 4.0 * uv * uv).sqrt());
        let (half, difference) = (0.5 * (cov[0] + cov[2]), 0.5 * (cov[0] - cov[2]));
        let largest = half + (difference * difference + cov[1] * cov[1]).sqrt();
        let is_textured =
            least > options.min_texture * noise && largest <= options.max_sigma_px * options.max_sigma_px;
        if !is_textured {
            return Answer::UNKNOWN;
        }
        let matches = self.coverage >= MIN_COVERAGE
            && self.residual <= options.max_residual * options.max_residual
            && self.step[0].abs().max(self.step[1].abs()) <= MAX_LAST_STEP_PX;
        if !matches {
            return Answer::REFUTED;
        }
        Answer { u: u + self.step[0], v: v + self.step[1], cov }
    }
}
