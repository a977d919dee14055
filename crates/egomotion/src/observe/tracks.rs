//! Corners followed in time and across the rig: the measurements of [`StereoTrack`].
//!
//! A corner of the left image is located in the right image of its time, in the left image of the
//! next frame and from there in the right one, and back again (the four-way check). Each of the
//! four images localises the corner with its own independent noise σ_I² G⁻¹, from which the
//! covariance of (x, y, d) at either end follows.

use nalgebra::{Matrix2, Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::corners::{Corner, corners};
use super::observation::StereoTrack;
use super::patch::{Freedom, Located, Patch};
use super::pyramid::{Gradients, Pyramid, gradients, smooth};
use super::spline::coefficients;
use crate::geometry::{Field, Gaussian, Grid, Image, StereoRig, Twist};

/// How corners are found and followed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackOptions {
    /// About how many corners are followed.
    pub corners: usize,
    /// Corners weaker than this are not used, in (grey levels per pixel)².
    pub least_strength: f32,
    /// Levels of the image pyramid.
    pub pyramid_levels: usize,
    /// Largest disparity that is searched, in pixels.
    pub largest_disparity_px: usize,
    /// Most iterations of one localisation.
    pub iterations: usize,
    /// Largest distance after following a corner there and back, in pixels.
    pub back_tolerance_px: f64,
    /// Largest root mean square difference of two windows, as a share of the window's contrast.
    pub largest_residual: f64,
}

impl Default for TrackOptions {
    fn default() -> Self {
        Self {
            corners: 1200,
            least_strength: 4.0,
            pyramid_levels: 5,
            largest_disparity_px: 128,
            iterations: 25,
            back_tolerance_px: 0.5,
            largest_residual: 0.5,
        }
    }
}

/// What tracking needs of one stereo frame, computed once.
#[derive(Debug, Clone)]
pub struct StereoPyramid {
    /// Pyramid of the left image.
    pub left: Pyramid,
    /// Pyramid of the right image.
    pub right: Pyramid,
    /// Gradients of the left image.
    pub gradients: Gradients,
    /// Spline coefficients of the left image.
    pub left_spline: Image,
    /// Spline coefficients of the right image.
    pub right_spline: Image,
}

impl StereoPyramid {
    /// Pyramids of a rectified pair.
    pub fn new(left: Image, right: Image, levels: usize) -> Self {
        let (left, right) = rayon::join(|| smooth(&left), || smooth(&right));
        let gradients = gradients(&left);
        let (left, right) = rayon::join(|| Pyramid::new(left, levels), || Pyramid::new(right, levels));
        let (left_spline, right_spline) =
            rayon::join(|| coefficients(&left.levels()[0]), || coefficients(&right.levels()[0]));
        Self { left, right, gradients, left_spline, right_spline }
    }
}

/// What is known before tracking.
#[derive(Debug, Clone, Copy, Default)]
pub struct Hints<'a> {
    /// Dense disparity of the earlier frame, as shifts u_left − u_right in pixels.
    pub shift: Option<&'a Field>,
    /// Expected scene motion, left camera.
    pub motion: Option<&'a Twist>,
    /// Pixels never to use, where `true`.
    pub mask: Option<&'a Grid<bool>>,
}

/// Corners of `before` followed to `after`, as tracks with covariances; the order is fixed.
pub fn stereo_tracks(
    before: &StereoPyramid,
    after: &StereoPyramid,
    rig: &StereoRig,
    hints: Hints<'_>,
    options: &TrackOptions,
) -> Vec<StereoTrack> {
    let (width, height) = before.left.size();
    let cell = ((width * height) as f64 / options.corners.max(1) as f64).sqrt().max(4.0) as usize;
    let mut found = corners(&before.gradients, cell, super::patch::RADIUS + 3, options.least_strength);
    if let Some(mask) = hints.mask {
        found.retain(|c| c.u < mask.width() && c.v < mask.height() && !mask.at(c.u, c.v));
    }
    let follow = Follower { before, after, rig, hints, options };
    let traced: Vec<Trace> = found.par_iter().filter_map(|corner| follow.trace(corner)).collect();
    let noise = grey_noise(&traced);
    traced.iter().filter_map(|trace| trace.track(rig, noise)).collect()
}

/// One corner in the four images, and how well each can localise it.
struct Trace {
    before: (f64, f64, f64),
    after: (f64, f64, f64),
    /// Covariance of a place per unit grey variance: (u, v) at t, u right at t, (u, v) at t′, u right at t′.
    shapes: (Matrix2<f64>, f64, Matrix2<f64>, f64),
    /// Mean squared differences of the three matches.
    residual: f64,
}

struct Follower<'a> {
    before: &'a StereoPyramid,
    after: &'a StereoPyramid,
    rig: &'a StereoRig,
    hints: Hints<'a>,
    options: &'a TrackOptions,
}

impl Follower<'_> {
    fn trace(&self, corner: &Corner) -> Option<Trace> {
        let (u, v) = (corner.u as f64, corner.v as f64);
        let patch = Patch::new(&self.before.left_spline, u, v)?;
        let shift = match self.hints.shift {
            Some(field) => f64::from(field.get(corner.u, corner.v)?),
            None => search_row(self.before, corner, self.options.largest_disparity_px)?,
        };
        let right = self.across(&patch, self.before, (u, v), shift)?;
        let shift = u - right.u;
        let (next, scale) = self.in_time(&patch, (u, v), shift)?;
        let (u_next, v_next) = (next.u.round() as usize, next.v.round() as usize);
        let masked = |m: &Grid<bool>| u_next < m.width() && v_next < m.height() && m.at(u_next, v_next);
        if self.hints.mask.is_some_and(masked) {
            return None;
        }
        let patch_after = Patch::new(&self.after.left_spline, next.u, next.v)?;
        let shift_guess = shift * scale;
        let right_after = self.across(&patch_after, self.after, (next.u, next.v), shift_guess)?;
        let shape = patch.covariance_shape()?;
        let shape_after = patch_after.covariance_shape()?;
        Some(Trace {
            before: (u, v, shift),
            after: (next.u, next.v, next.u - right_after.u),
            shapes: (shape, patch.row_variance_shape(), shape_after, patch_after.row_variance_shape()),
            residual: (right.residual + next.residual + right_after.residual) / 3.0,
        })
    }

    fn acceptable(&self, patch: &Patch, found: &Located) -> bool {
        found.residual.sqrt() <= self.options.largest_residual * patch.contrast()
    }

    /// Left to right along the row, and back.
    fn across(
        &self,
        patch: &Patch,
        frame: &StereoPyramid,
        (u, v): (f64, f64),
        shift: f64,
    ) -> Option<Located> {
        let n = self.options.iterations;
        let found = patch.locate(&frame.right_spline, (u - shift, v), 1.0, Freedom::Row, n)?;
        if !self.acceptable(patch, &found) || self.rig.disparity_from_shift(u - found.u) <= 0.0 {
            return None;
        }
        let back = Patch::new(&frame.right_spline, found.u, found.v)?;
        let home = back.locate(&frame.left_spline, (u, v), 1.0, Freedom::Row, n)?;
        ((home.u - u).abs() <= self.options.back_tolerance_px).then_some(found)
    }

    /// Left to the next left, from the predicted place or coarse to fine, and back; also the magnification.
    fn in_time(&self, patch: &Patch, (u, v): (f64, f64), shift: f64) -> Option<(Located, f64)> {
        let (start, scale) = match self.hints.motion {
            Some(motion) => self.predict((u, v), shift, motion)?,
            None => (self.coarse_to_fine((u, v))?, 1.0),
        };
        let n = self.options.iterations;
        let found = patch.locate(&self.after.left_spline, start, scale, Freedom::Plane, n)?;
        if !self.acceptable(patch, &found) {
            return None;
        }
        let back = Patch::new(&self.after.left_spline, found.u, found.v)?;
        let home = back.locate(&self.before.left_spline, (u, v), 1.0 / scale, Freedom::Plane, n)?;
        let distance = (home.u - u).hypot(home.v - v);
        (distance <= self.options.back_tolerance_px).then_some((found, scale))
    }

    /// Where the still world's point would be, and by how much its image grows.
    fn predict(&self, (u, v): (f64, f64), shift: f64, motion: &Twist) -> Option<((f64, f64), f64)> {
        let (x, y) = self.rig.image_from_pixel(u, v);
        let d = self.rig.disparity_from_shift(shift);
        let moved = motion.exp().apply(&self.rig.point(&Vector3::new(x, y, d))?);
        let after = self.rig.project(&moved)?;
        Some((self.rig.pixel_from_image(after.x, after.y), after.z / d))
    }

    /// A start at full resolution from the coarsest level down.
    ///
    /// The levels serve as spline coefficients as they are, which only smooths them a little more.
    fn coarse_to_fine(&self, (u, v): (f64, f64)) -> Option<(f64, f64)> {
        let levels = self.before.left.levels().len().min(self.after.left.levels().len());
        let mut flow = (0.0, 0.0);
        for level in (1..levels).rev() {
            let size = (1 << level) as f64;
            let (cu, cv) = (u / size, v / size);
            let found = Patch::new(&self.before.left.levels()[level], cu, cv).and_then(|patch| {
                let start = (cu + flow.0 / size, cv + flow.1 / size);
                let image = &self.after.left.levels()[level];
                patch.locate(image, start, 1.0, Freedom::Plane, self.options.iterations)
            });
            if let Some(found) = found {
                flow = ((found.u - cu) * size, (found.v - cv) * size);
            }
        }
        Some((u + flow.0, v + flow.1))
    }
}

/// Disparity of a corner by searching its row at half resolution; `None` if not clearly the best.
fn search_row(frame: &StereoPyramid, corner: &Corner, largest_px: usize) -> Option<f64> {
    const RADIUS: usize = 4;
    let level = usize::from(frame.left.levels().len() > 1);
    let size = 1 << level;
    let (left, right) = (&frame.left.levels()[level], frame.right.levels().get(level)?);
    let (u, v) = (corner.u / size, corner.v / size);
    if u < RADIUS || v < RADIUS || u + RADIUS >= left.width() || v + RADIUS >= left.height() {
        return None;
    }
    let columns = 2 * RADIUS + 1;
    let mean = |image: &Image, u: usize| {
        let rows = v - RADIUS..=v + RADIUS;
        let sum: f32 = rows.map(|row| image.row(row)[u - RADIUS..=u + RADIUS].iter().sum::<f32>()).sum();
        sum / (columns * columns) as f32
    };
    let here = mean(left, u);
    let cost = |shift: usize| -> f32 {
        let there = mean(right, u - shift);
        (v - RADIUS..=v + RADIUS)
            .map(|row| {
                let a = &left.row(row)[u - RADIUS..=u + RADIUS];
                let b = &right.row(row)[u - shift - RADIUS..=u - shift + RADIUS];
                a.iter().zip(b).map(|(a, b)| ((a - here) - (b - there)).abs()).sum::<f32>()
            })
            .sum()
    };
    let most = (largest_px / size).min(u - RADIUS);
    let costs: Vec<f32> = (0..=most).map(cost).collect();
    let best = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;
    let rival = costs.iter().enumerate().filter(|(k, _)| k.abs_diff(best) > 1).map(|(_, &c)| c);
    let rival = rival.fold(f32::INFINITY, f32::min);
    (costs[best] < 0.85 * rival).then_some((best * size) as f64)
}

/// Variance of a grey level of one image, from the median residual of all matches.
fn grey_noise(traces: &[Trace]) -> f64 {
    let mut residuals: Vec<f64> = traces.iter().map(|trace| trace.residual).collect();
    if residuals.is_empty() {
        return 1.0;
    }
    let middle = residuals.len() / 2;
    let (_, &mut median, _) = residuals.select_nth_unstable_by(middle, f64::total_cmp);
    0.5 * median
}

impl Trace {
    /// The track with its covariances, given the pooled variance of grey levels.
    fn track(&self, rig: &StereoRig, pooled: f64) -> Option<StereoTrack> {
        // A window's own residual counts where it is worse than the image at large.
        let noise = 0.5 * (pooled + (0.5 * self.residual).max(pooled)).max(QUANTISATION);
        let aspect = rig.aspect();
        let end = |(u, v, shift): (f64, f64, f64), plane: &Matrix2<f64>, row: f64| {
            let (x, y) = rig.image_from_pixel(u, v);
            let (xx, xy, yy) = (plane[(0, 0)], plane[(0, 1)] * aspect, plane[(1, 1)] * aspect * aspect);
            // d is located along the row alone, from the same noise of the left window as x: that
            // makes cov(x, d) = 1/G_xx, cov(y, d) = 0, and the right window adds as much again.
            let cov = Matrix3::new(xx, xy, row, xy, yy, 0.0, row, 0.0, 2.0 * row) * noise;
            Gaussian { mean: Vector3::new(x, y, rig.disparity_from_shift(shift)), cov }
        };
        let (plane, row, plane_after, row_after) = &self.shapes;
        let track = StereoTrack {
            before: end(self.before, plane, *row),
            after: end(self.after, plane_after, *row_after),
        };
        (track.before.mean.z > 0.0 && track.after.mean.z > 0.0).then_some(track)
    }
}

/// Variance of a grey level rounded to whole numbers, the least that an image can have.
const QUANTISATION: f64 = 1.0 / 12.0;
