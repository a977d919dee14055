//! Sub-pixel disparity with its standard deviation: photometric refinement along the row.
//!
//! One Gauss–Newton step of B. Lucas and T. Kanade, "An iterative image registration technique with
//! an application to stereo vision", IJCAI 1981, repeated. Each pixel of the window is compared at
//! its *own* disparity, so the window follows slanted and curved surfaces, and only pixels of the
//! same surface count. The disparity of the semi-global matching enters as a prior, which alone
//! remains where there is no texture.

use rayon::prelude::*;

use super::lucas_kanade::{Fit, LANES, Sums, WindowPixel, lanes};
use crate::geometry::Image;
use crate::observe::spline;

/// Half width and half height of the window, in pixels.
const RADIUS: (usize, usize) = (4, 3);
/// Disparity difference up to which a pixel of the window is of the same surface: at the centre, and
/// per pixel of distance from it.
const SAME_SURFACE: (f32, f32) = (0.5, 0.25);
/// Standard deviation of the semi-global disparity, in pixels.
const PRIOR_SIGMA: f32 = 0.5;
/// Standard deviation where the refinement contradicts the semi-global disparity, in pixels.
const CONTRADICTED_SIGMA: f32 = 1.0;
/// Correction of the semi-global disparity beyond which it counts as contradicted, in pixels.
const CONTRADICTION: f32 = 1.0;
/// What no image noise explains (interpolation), in pixels.
const MODEL_SIGMA: f32 = 0.01;
/// Variance, in squares of the last step, for the depth inside a window that no one step fits;
/// measured on Middlebury pairs.
const MISFIT_WEIGHT: f32 = 2.5;
/// Offset of the minimum of the parabola through the costs of `best` and its neighbours, −½ … ½; 0 at the ends.
pub(super) fn parabola(costs: &[u16], best: usize) -> f32 {
    let cost = |i: usize| costs.get(i).map(|&c| f32::from(c));
    let (Some(before), Some(here), Some(after)) =
        (best.checked_sub(1).and_then(cost), cost(best), cost(best + 1))
    else {
        return 0.0;
    };
    let curvature = before - 2.0 * here + after;
    if curvature > 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// The planes of the refinement, each with a margin of a window's radius all round.
#[derive(Debug, Clone, Default)]
pub(super) struct Refinement {
    layout: Layout,
    /// Semi-global disparity smoothed over the surface; NaN is missing.
    prior: Vec<f32>,
    /// Disparity at which the images are compared; NaN is missing.
    disparity: Vec<f32>,
    /// Left minus right grey level there, and its derivative by the disparity; 0 where missing.
    difference: Vec<f32>,
    slope: Vec<f32>,
    /// The answer: disparity, standard deviation, and noise variance of the difference.
    refined: Vec<f32>,
    sigma: Vec<f32>,
    noise: Vec<f32>,
}

/// Rows of `stride` values; the image begins at (RADIUS.0, RADIUS.1).
#[derive(Debug, Clone, Copy, Default)]
struct Layout {
    width: usize,
    height: usize,
    stride: usize,
}

impl Layout {
    fn new(width: usize, height: usize) -> Self {
        Self { width, height, stride: width.next_multiple_of(LANES) + 2 * RADIUS.0 }
    }

    fn len(self) -> usize {
        self.stride * (self.height + 2 * RADIUS.1)
    }

    /// Index of the first pixel of row `v`.
    fn start(self, v: usize) -> usize {
        (v + RADIUS.1) * self.stride + RADIUS.0
    }

    /// The image's rows of a plane, each with its number.
    fn rows(self, plane: &mut [f32]) -> impl IndexedParallelIterator<Item = (usize, &mut [f32])> {
        let rows = plane.par_chunks_mut(self.stride).skip(RADIUS.1).take(self.height);
        rows.map(move |row| &mut row[RADIUS.0..RADIUS.0 + self.width]).enumerate()
    }

    /// The pixels of a window.
    fn window(self) -> Vec<WindowPixel> {
        let (ru, rv) = (RADIUS.0 as isize, RADIUS.1 as isize);
        let offsets = (-rv..=rv).flat_map(|j| (-ru..=ru).map(move |i| (i, j)));
        offsets
            .map(|(i, j)| {
                let tolerance = SAME_SURFACE.0 + SAME_SURFACE.1 * (i.abs() + j.abs()) as f32;
                WindowPixel { offset: j * self.stride as isize + i, tolerance }
            })
            .collect()
    }
}

impl Refinement {
    /// Refine `coarse` (row-major, NaN is missing) by `steps` steps.
    pub(super) fn refine(&mut self, left: &Image, right: &Image, coarse: &[f32], steps: usize) {
        self.start(left.width(), left.height());
        let layout = self.layout;
        let rows = layout.rows(&mut self.refined).zip(coarse.par_chunks(layout.width));
        rows.for_each(|((_, row), coarse)| row.copy_from_slice(coarse));
        smooth(layout, &self.refined, &mut self.prior);
        self.disparity.copy_from_slice(&self.prior);
        let right = spline::row_coefficients(right);
        for step in 0..steps {
            if step > 0 {
                smooth(layout, &self.refined, &mut self.disparity);
            }
            self.compare(left, &right);
            let typical_noise = self.typical_noise();
            self.solve(typical_noise);
        }
    }

    /// Row `v` of the answer: disparity and standard deviation, NaN is missing.
    pub(super) fn row(&self, v: usize) -> (&[f32], &[f32]) {
        let row = self.layout.start(v)..self.layout.start(v) + self.layout.width;
        (&self.refined[row.clone()], &self.sigma[row])
    }

    fn start(&mut self, width: usize, height: usize) {
        self.layout = Layout::new(width, height);
        let planes = [
            (&mut self.prior, f32::NAN),
            (&mut self.disparity, f32::NAN),
            (&mut self.difference, 0.0),
            (&mut self.slope, 0.0),
            (&mut self.refined, f32::NAN),
            (&mut self.sigma, f32::NAN),
            (&mut self.noise, f32::NAN),
        ];
        for (plane, missing) in planes {
            plane.clear();
            plane.resize(self.layout.len(), missing);
        }
    }

    /// Compare the left image with the right one (as row coefficients) read at the disparity of each pixel.
    fn compare(&mut self, left: &Image, right: &Image) {
        let layout = self.layout;
        let planes = layout.rows(&mut self.disparity).zip(layout.rows(&mut self.difference));
        planes.zip(layout.rows(&mut self.slope)).for_each(
            |(((v, disparity), (_, difference)), (_, slope))| {
                let (left, right) = (left.row(v), right.row(v));
                for (u, disparity) in disparity.iter_mut().enumerate() {
                    let neighbours = (u.checked_sub(1).and_then(|u| left.get(u)), left.get(u + 1));
                    let grey = read(right, u as f32 - *disparity);
                    (difference[u], slope[u]) = match (neighbours, grey) {
                        // The right image's own slope would carry the noise of the grey level read there,
                        // and pull every answer towards half pixels.
                        ((Some(before), Some(after)), Some(grey)) => (left[u] - grey, 0.5 * (after - before)),
                        _ => {
                            *disparity = f32::NAN;
                            (0.0, 0.0)
                        }
                    };
                }
            },
        );
    }

    /// Median over the image of the noise variance of the last step; `None` before the first.
    fn typical_noise(&self) -> Option<f32> {
        let mut sample: Vec<f32> = self.noise.iter().step_by(7).copied().filter(|n| !n.is_nan()).collect();
        let middle = sample.len() / 2;
        (!sample.is_empty()).then(|| *sample.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    /// Solve for the disparity of every window.
    fn solve(&mut self, typical_noise: Option<f32>) {
        let layout = self.layout;
        let window = layout.window();
        let Self { prior, disparity, difference, slope, refined, sigma, noise, .. } = self;
        let answers = layout.rows(refined).zip(layout.rows(sigma)).zip(layout.rows(noise));
        answers.for_each(|(((v, refined), (_, sigma)), (_, noise))| {
            let start = layout.start(v);
            for u in (0..layout.width).step_by(LANES) {
                let sums = Sums::gather(&window, start + u, disparity, difference, slope);
                let answers = refined[u..].iter_mut().zip(&mut sigma[u..]).zip(&mut noise[u..]);
                for (lane, ((refined, sigma), noise)) in answers.take(LANES).enumerate() {
                    let at = start + u + lane;
                    let fit = sums.fit(lane, typical_noise);
                    (*refined, *sigma) = posterior(prior[at], disparity[at], fit);
                    *noise = fit.noise;
                }
            }
        });
    }
}

/// Grey level at column `u` of a row, from its spline coefficients; `None` outside.
fn read(coefficients: &[f32], u: f32) -> Option<f32> {
    if !(u >= 1.0 && u < coefficients.len() as f32 - 2.0) {
        return None;
    }
    let first = u as usize - 1;
    let &[a, b, c, d] = coefficients.get(first..first + 4)? else { return None };
    let w = spline::weights(u - u.floor());
    Some(w[0] * a + w[1] * b + w[2] * c + w[3] * d)
}

/// The mean of each pixel's surface over its window.
fn smooth(layout: Layout, plane: &[f32], smoothed: &mut [f32]) {
    let window = layout.window();
    layout.rows(smoothed).for_each(|(v, smoothed)| {
        for (chunk, smoothed) in smoothed.chunks_mut(LANES).enumerate() {
            let at = layout.start(v) + chunk * LANES;
            let mean = surface_mean(&window, at, plane);
            smoothed.copy_from_slice(&mean[..smoothed.len()]);
        }
    });
}

/// The mean of the surface over eight windows; missing where the centre is.
#[inline(never)]
fn surface_mean(window: &[WindowPixel], at: usize, plane: &[f32]) -> [f32; LANES] {
    let centre = lanes(plane, at);
    let (mut count, mut sum) = ([0.0; LANES], [0.0; LANES]);
    for &WindowPixel { offset, tolerance } in window {
        let near = lanes(plane, at.wrapping_add_signed(offset));
        for lane in 0..LANES {
            let change = near[lane] - centre[lane];
            // A mask instead of a choice: it vectorises, and is safe where the change is NaN.
            let same = if change.abs() <= tolerance { u32::MAX } else { 0 };
            count[lane] += f32::from_bits(same & 1.0_f32.to_bits());
            sum[lane] += f32::from_bits(same & change.to_bits());
        }
    }
    std::array::from_fn(|lane| centre[lane] + sum[lane] / count[lane])
}

/// Disparity and its standard deviation from the semi-global disparity and what the grey levels say
/// at `compared`; NaN where there is no semi-global disparity.
fn posterior(prior: f32, compared: f32, fit: Fit) -> (f32, f32) {
    if compared.is_nan() || fit.information.is_nan() {
        return (prior, if prior.is_nan() { f32::NAN } else { PRIOR_SIGMA });
    }
    let prior_information = PRIOR_SIGMA.powi(-2);
    let information = fit.information + prior_information;
    let refined = compared + (fit.pull + prior_information * (prior - compared)) / information;
    // A surface on which the window's pixels do not agree still moves in the last step.
    let misfit = MISFIT_WEIGHT * (refined - compared).powi(2);
    let sigma = (information.recip() + misfit + MODEL_SIGMA * MODEL_SIGMA).sqrt();
    if (refined - prior).abs() <= CONTRADICTION { (refined, sigma) } else { (prior, CONTRADICTED_SIGMA) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parabola_finds_its_minimum() {
        let costs: Vec<u16> = (0..5).map(|d| (1000.0 * (f64::from(d) - 2.3).powi(2)) as u16).collect();
        assert!((parabola(&costs, 2) - 0.3).abs() < 1e-3);
        assert_eq!((parabola(&costs, 0), parabola(&costs, 4), parabola(&[7, 7, 7], 1)), (0.0, 0.0, 0.0));
    }
}
