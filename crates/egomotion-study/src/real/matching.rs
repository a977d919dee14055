//! Disparity and flow matched in three stereo frames t−1, t, t+1, and the observations of both approaches at t.

use nalgebra::Vector2;
use thiserror::Error;

use egomotion::geometry::{Field, Gaussian, Grid, StereoRig};
use egomotion::observe::disparity::DisparityError;
use egomotion::observe::flow::FlowError;
use egomotion::observe::{
    DensePair, DepthFlow, DisparityMap, DisparityMatcher, DisparityOptions, FlowField, FlowOptions, Pyramid,
    StereoFlow, dense_flow,
};
use egomotion::sim::StereoImages;

/// Levels of the pyramids in which flow is found: each more doubles the motion that can be followed.
const PYRAMID_LEVELS: usize = 5;
/// Gradient of disparity, in pixels per pixel, from which on a stencil is taken to straddle a depth edge.
///
/// A smaller limit leaves out slanted surfaces too, a larger one admits differences across edges.
const EDGE_GRADIENT: f64 = 1.0;

/// Why frames could not be matched.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MatchingError {
    /// A pair's images differ in size.
    #[error(transparent)]
    Disparity(#[from] DisparityError),
    /// Images of different times differ in size.
    #[error(transparent)]
    Flow(#[from] FlowError),
}

/// Disparity and flow of three stereo frames, nothing of which knows how the cameras moved.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MatchedFrames {
    /// The rig.
    pub(super) rig: StereoRig,
    /// Disparity at t−1, t, t+1 as it was matched.
    pub(super) disparity: [DisparityMap; 3],
    /// The same, rounded to a step of disparity.
    pub(super) rounded: [DisparityMap; 3],
    /// Displacement in the left image from t to t+1.
    pub(super) flow: FlowField,
    /// Image velocity at t in the left and the right image: half of what lies between t−1 and t+1.
    pub(super) velocity: [FlowField; 2],
}

impl MatchedFrames {
    /// Match three frames; disparity is also rounded to `levels` steps in a pixel.
    ///
    /// # Errors
    /// [`MatchingError`] when the images differ in size.
    pub(super) fn new(
        frames: &[StereoImages; 3],
        rig: &StereoRig,
        levels: f32,
    ) -> Result<Self, MatchingError> {
        // Gradients and differences are those of matched disparities, not of filled ones.
        let mut matcher =
            DisparityMatcher::new(DisparityOptions { fill: false, ..DisparityOptions::default() });
        let [a, b, c] = frames;
        let mut shift = |pair: &StereoImages| matcher.compute(&pair.left, &pair.right);
        let disparity = [shift(a)?, shift(b)?, shift(c)?];
        let pyramids = |side: fn(&StereoImages) -> &egomotion::geometry::Image| {
            frames.each_ref().map(|pair| Pyramid::new(egomotion::observe::smooth(side(pair)), PYRAMID_LEVELS))
        };
        let flow = |from: &Pyramid, to: &Pyramid| dense_flow(from, to, None, &FlowOptions::default());
        let [before, now, after] = pyramids(|pair| &pair.left);
        let ahead = flow(&now, &after)?;
        let left = central(&ahead, &flow(&now, &before)?);
        let [before, now, after] = pyramids(|pair| &pair.right);
        let right = central(&flow(&now, &after)?, &flow(&now, &before)?);
        let rounded = disparity.each_ref().map(|map| rounded(map, levels));
        Ok(Self { rig: *rig, disparity, rounded, flow: ahead, velocity: [left, right] })
    }

    /// The rounded maps of t and t+1 with the displacement between them: the discrete approach.
    pub(super) fn pair(&self) -> DensePair<'_> {
        let [_, before, after] = &self.rounded;
        DensePair {
            rig: &self.rig,
            before,
            after,
            flow: &self.flow,
            flow_right: None,
            external_disparity: false,
        }
    }

    /// Disparity, its central differences in space and in time, and the image velocity, at a pixel at t: (7).
    pub(super) fn depth_flow(&self, u: usize, v: usize) -> Option<DepthFlow> {
        let [before, now, after] = &self.rounded;
        let (x, y) = self.rig.image_from_pixel(u as f64, v as f64);
        let (d, variance) = self.disparity_at(now, u, v)?;
        let (du, dv) = now.shift.gradient(u, v)?;
        let (dx, dy) = (f64::from(du), f64::from(dv) / self.rig.aspect());
        let ends = f64::from(after.shift.get(u, v)?) - f64::from(before.shift.get(u, v)?);
        if dx.abs().max(dy.abs()) >= EDGE_GRADIENT {
            return None;
        }
        let half = 0.5 * variance;
        Some(DepthFlow {
            x_px: x,
            y_px: y,
            disparity: Gaussian::independent([d, dx, dy, 0.5 * ends], [variance, half, half, half]),
            flow: self.velocity_at(u, v)?,
        })
    }

    /// Disparity and the image velocity of both cameras at a pixel at t: (9), (14) and (3).
    ///
    /// The right camera's is read at the measured place of the same point, x − d.
    pub(super) fn stereo_flow(&self, u: usize, v: usize) -> Option<StereoFlow> {
        let (x, y) = self.rig.image_from_pixel(u as f64, v as f64);
        let (d, variance) = self.disparity_at(&self.rounded[1], u, v)?;
        let left = self.velocity_at(u, v)?;
        let right = &self.velocity[1];
        let at = u as f64 - self.rig.shift_from_disparity(d);
        let right_x = right.u.sample(at, v as f64)?;
        let right_variance = f64::from(right.cov_uu.at((at.round() as usize).min(right.size().0 - 1), v));
        let mean = [d, left.mean.x, left.mean.y, right_x];
        let variances = [variance, left.cov[(0, 0)], left.cov[(1, 1)], right_variance];
        Some(StereoFlow { x_px: x, y_px: y, measured: Gaussian::independent(mean, variances) })
    }

    fn disparity_at(&self, map: &DisparityMap, u: usize, v: usize) -> Option<(f64, f64)> {
        let d = self.rig.disparity_from_shift(f64::from(map.shift.get(u, v)?));
        let sigma = f64::from(map.sigma.get(u, v)?);
        (d > 0.0).then_some((d, sigma * sigma))
    }

    /// The left image's velocity in image coordinates.
    fn velocity_at(&self, u: usize, v: usize) -> Option<Gaussian<2>> {
        let velocity = self.velocity[0].get(u, v)?;
        let scale = nalgebra::Matrix2::from_diagonal(&Vector2::new(1.0, self.rig.aspect()));
        Some(velocity.propagate(scale * velocity.mean, &scale))
    }
}

/// Half of the displacement from t−1 to t+1, from those of t to t+1 and of t to t−1.
fn central(ahead: &FlowField, back: &FlowField) -> FlowField {
    let combined = |a: &Grid<f32>, b: &Grid<f32>, sign: f32, share: f32| {
        let mut out = a.clone();
        out.values_mut().iter_mut().zip(b.values()).for_each(|(a, b)| *a = share * (*a + sign * b));
        out
    };
    let velocity = |a: &Field, b: &Field| Field::from_grid(combined(a.grid(), b.grid(), -1.0, 0.5));
    let cov = |a: &Grid<f32>, b: &Grid<f32>| combined(a, b, 1.0, 0.25);
    FlowField {
        u: velocity(&ahead.u, &back.u),
        v: velocity(&ahead.v, &back.v),
        cov_uu: cov(&ahead.cov_uu, &back.cov_uu),
        cov_uv: cov(&ahead.cov_uv, &back.cov_uv),
        cov_vv: cov(&ahead.cov_vv, &back.cov_vv),
    }
}

/// The map with disparity rounded to `levels` steps in a pixel, floor(d levels + ½)/levels.
fn rounded(map: &DisparityMap, levels: f32) -> DisparityMap {
    let mut rounded = map.clone();
    for v in 0..rounded.shift.height() {
        rounded.shift.row_mut(v).iter_mut().for_each(|d| *d = (*d * levels + 0.5).floor() / levels);
    }
    rounded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disparity_is_rounded_to_sixteenths() {
        let (width, height) = (4, 1);
        let d = [10.031_0, 10.032_0, f32::NAN, 7.0];
        let shift = Field::from_grid(Grid::from_fn(width, height, |u, _| d[u]));
        let map = rounded(&DisparityMap { sigma: shift.clone(), shift }, 16.0);
        assert_eq!([0, 1, 2, 3].map(|u| map.shift.get(u, 0)), [Some(10.0), Some(10.0625), None, Some(7.0)]);
    }

    #[test]
    fn velocity_is_the_central_difference_along_the_path() {
        let plane = |value: f32| Field::from_grid(Grid::filled(2, 1, value));
        let mut ahead = FlowField::prediction(plane(3.0), plane(-1.0));
        ahead.cov_uu = Grid::filled(2, 1, 0.2);
        let mut back = FlowField::prediction(plane(-2.0), plane(1.0));
        back.u.set(1, 0, None);
        let velocity = central(&ahead, &back);
        assert_eq!(velocity.get(0, 0).unwrap().mean, Vector2::new(2.5, -1.0));
        assert!((velocity.cov_uu.at(0, 0) - 0.05).abs() < 1e-7);
        assert!(velocity.get(1, 0).is_none());
    }
}
