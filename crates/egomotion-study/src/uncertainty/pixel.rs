//! The measurements of both approaches at one pixel of the synthetic world, without noise.

use nalgebra::Vector3;

use crate::synthetic::{FrameTime, SyntheticWorld};
use egomotion::geometry::Gaussian;
use egomotion::geometry::image_flow;
use egomotion::observe::{DepthFlow, DepthTrack, StereoFlow, StereoTrack};

/// Disparity at a pixel and at its four neighbours, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stencil {
    /// At the pixel.
    pub(super) centre: f64,
    /// One column to the left.
    pub(super) left: f64,
    /// One column to the right.
    pub(super) right: f64,
    /// One row up.
    pub(super) above: f64,
    /// One row down.
    pub(super) below: f64,
}

/// The exact measurements at one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ExactPixel {
    /// Pixel (u, v).
    pub(super) pixel: (usize, usize),
    /// Image coordinates (x, y), in pixels.
    pub(super) image_px: (f64, f64),
    /// Depth Z at t, in metres.
    pub(super) depth_m: f64,
    /// Disparity at t − 1, in pixels.
    pub(super) before: f64,
    /// Disparities at t.
    pub(super) now: Stencil,
    /// Disparities at t + 1.
    pub(super) after: Stencil,
    /// Flow (vx, vy) of the left image, in pixels per interval.
    pub(super) flow: [f64; 2],
    /// Flow vx of the right image, in pixels per interval.
    pub(super) flow_right_x: f64,
    /// Displacement (x′ − x, y′ − y) of the point, in pixels.
    pub(super) displacement: [f64; 2],
    /// Disparity d′ of the point after the motion, in pixels.
    pub(super) moved: f64,
}

/// Standard deviations of the measurements at a pixel, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PixelNoise {
    /// Of every disparity.
    pub(super) disparity_px: f64,
    /// Of every component of flow, and of the later end of a displacement.
    pub(super) flow_px: f64,
}

impl PixelNoise {
    /// Variances (σ²_d, σ²_v), in pixels².
    pub(super) fn variances(&self) -> (f64, f64) {
        (self.disparity_px.powi(2), self.flow_px.powi(2))
    }
}

impl Stencil {
    /// Around the row-major `index` of a plane; `None` past its end or where something is missing.
    fn of(plane: &[f64], index: usize, width: usize) -> Option<Self> {
        let at = |i: Option<usize>| plane.get(i?).copied().filter(|d| d.is_finite());
        Some(Self {
            centre: at(Some(index))?,
            left: at(index.checked_sub(1))?,
            right: at(index.checked_add(1))?,
            above: at(index.checked_sub(width))?,
            below: at(index.checked_add(width))?,
        })
    }

    /// Central differences (d_x, d_y), in pixels per pixel.
    pub(super) fn gradient(&self) -> [f64; 2] {
        [0.5 * (self.right - self.left), 0.5 * (self.below - self.above)]
    }
}

impl ExactPixel {
    /// The measurements at the pixel with row-major `index`, usable or not; `None` at the image's border,
    /// and where nothing is seen.
    pub(super) fn at(world: &SyntheticWorld, index: usize) -> Option<Self> {
        let (rig, phi) = (&world.rig, &world.phi);
        let (u, v) = (index % rig.width_px, index / rig.width_px);
        if u == 0 || u + 1 == rig.width_px {
            return None;
        }
        let at = |when| Stencil::of(world.disparity(when), index, rig.width_px);
        let (before, now, after) = (at(FrameTime::Before)?, at(FrameTime::Now)?, at(FrameTime::After)?);
        let (x, y) = rig.image_from_pixel(u as f64, v as f64);
        let xyd = Vector3::new(x, y, now.centre);
        let point = rig.point(&xyd)?;
        let shift = rig.project(&phi.exp().apply(&point))? - xyd;
        let baseline = Vector3::new(rig.baseline_m, 0.0, 0.0);
        let right = image_flow(&phi.seen_from(&baseline), x - now.centre, y, point.z, rig.focal_px);
        Some(Self {
            pixel: (u, v),
            image_px: (x, y),
            depth_m: point.z,
            before: before.centre,
            now,
            after,
            flow: image_flow(phi, x, y, point.z, rig.focal_px).into(),
            flow_right_x: right.x,
            displacement: [shift.x, shift.y],
            moved: now.centre + shift.z,
        })
    }

    /// The measurement of the differential DCCE: central differences, so σ²_di = ½ σ²_d.
    pub(super) fn depth_flow(&self, noise: &PixelNoise) -> DepthFlow {
        let (d, v) = noise.variances();
        let [dx, dy] = self.now.gradient();
        let dt = 0.5 * (self.after.centre - self.before);
        DepthFlow {
            x_px: self.image_px.0,
            y_px: self.image_px.1,
            disparity: Gaussian::independent([self.now.centre, dx, dy, dt], [d, 0.5 * d, 0.5 * d, 0.5 * d]),
            flow: Gaussian::independent(self.flow, [v, v]),
        }
    }

    /// The measurement of the discrete DCCE: disparity at t and t′, and central differences at t′.
    pub(super) fn depth_track(&self, noise: &PixelNoise) -> DepthTrack {
        let (d, v) = noise.variances();
        let [dx, dy] = self.after.gradient();
        DepthTrack {
            x_px: self.image_px.0,
            y_px: self.image_px.1,
            disparity: Gaussian::independent(
                [self.now.centre, self.after.centre, dx, dy],
                [d, d, 0.5 * d, 0.5 * d],
            ),
            displacement: Gaussian::independent(self.displacement, [v, v]),
        }
    }

    /// The measurement of the discrete DCCE with the variances that section 5.6 takes.
    ///
    /// It takes σ²_di = ½ σ²_d for every derivative; for the difference d′ − d that is a quarter of the truth.
    pub(super) fn depth_track_as_in_5_6(&self, noise: &PixelNoise) -> DepthFlow {
        let track = self.depth_track(noise);
        let mut printed = track.as_printed();
        printed.disparity.cov[(3, 3)] = 0.5 * track.disparity.cov[(0, 0)];
        printed
    }

    /// The measurement of the differential DV.
    pub(super) fn stereo_flow(&self, noise: &PixelNoise) -> StereoFlow {
        let (d, v) = noise.variances();
        StereoFlow {
            x_px: self.image_px.0,
            y_px: self.image_px.1,
            measured: Gaussian::independent(
                [self.now.centre, self.flow[0], self.flow[1], self.flow_right_x],
                [d, v, v, v],
            ),
        }
    }

    /// The measurement of the discrete DV: the earlier end is a pixel, the later one is tracked.
    pub(super) fn stereo_track(&self, noise: &PixelNoise) -> StereoTrack {
        let (d, v) = noise.variances();
        let (x, y) = self.image_px;
        let [dx, dy] = self.displacement;
        StereoTrack {
            before: Gaussian::independent([x, y, self.now.centre], [0.0, 0.0, d]),
            after: Gaussian::independent([x + dx, y + dy, self.moved], [v, v, d]),
        }
    }
}
