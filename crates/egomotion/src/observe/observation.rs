//! The four kinds of observation, which are the paper's four methods.
//!
//! | | differential | discrete |
//! |---|---|---|
//! | depth change (DCCE) | [`DepthFlow`] | [`DepthTrack`] |
//! | binocular flow (DV) | [`StereoFlow`] | [`StereoTrack`] |
//!
//! Each holds what was *measured*, in pixels, with its covariance. Depths are derived from it by
//! one Jacobian, never chained through correlated intermediates.

use nalgebra::{Matrix4, SMatrix, Vector3, Vector4};

use crate::geometry::{Gaussian, RigErrors, StereoRig};

/// Disparity, its gradient and its rate at one pixel, and the flow there: what (7) and (11) need.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthFlow {
    /// Image coordinate x, in pixels.
    pub x_px: f64,
    /// Image coordinate y, in pixels.
    pub y_px: f64,
    /// (d, d_x, d_y, d_t): disparity, its spatial gradient and its rate at a fixed pixel.
    pub disparity: Gaussian<4>,
    /// (v_x, v_y), in pixels per interval.
    pub flow: Gaussian<2>,
}

/// Disparities at one pixel at t and t′, the gradient at t′, and a displacement: what (17) needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthTrack {
    /// Image coordinate x at t, in pixels.
    pub x_px: f64,
    /// Image coordinate y at t, in pixels.
    pub y_px: f64,
    /// (d, d′, d′_x, d′_y): disparity at (x, y) at t and at t′, and its gradient there at t′.
    pub disparity: Gaussian<4>,
    /// (x′ − x, y′ − y), in pixels.
    pub displacement: Gaussian<2>,
}

/// Disparity at one pixel and the flow of both cameras there: what (9) and (14) need.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoFlow {
    /// Image coordinate x, in pixels.
    pub x_px: f64,
    /// Image coordinate y, in pixels.
    pub y_px: f64,
    /// (d, v_x left, v_y left, v_x right).
    pub measured: Gaussian<4>,
}

/// One point's (x, y, d) before and after: what (21) and (22) need.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoTrack {
    /// (x, y, d) at t.
    pub before: Gaussian<3>,
    /// (x, y, d) at t′.
    pub after: Gaussian<3>,
}

/// Depth, its gradient and its change at a fixed pixel, with the flow: the common form of
/// [`DepthFlow`] and [`DepthTrack`], from which both their VZ and their motion constraint follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthChange {
    /// Image coordinate x, in pixels.
    pub x_px: f64,
    /// Image coordinate y, in pixels.
    pub y_px: f64,
    /// (Z, Zx, Zy, Zt) in metres, metres per pixel and metres per interval.
    pub depth: Gaussian<4>,
    /// (v_x, v_y), in pixels per interval.
    pub flow: Gaussian<2>,
}

impl DepthFlow {
    /// Depths from disparities by (33), with covariance by (32), (35); `bf` is b f. Needs d > 0.
    pub fn depth_change(&self, bf: f64) -> DepthChange {
        let [d, dx, dy, dt] = self.disparity.mean.into();
        let (z, slope, bend) = (bf / d, -bf / (d * d), 2.0 * bf / (d * d * d));
        let jacobian = Matrix4::new(
            slope,
            0.0,
            0.0,
            0.0, //
            bend * dx,
            slope,
            0.0,
            0.0, //
            bend * dy,
            0.0,
            slope,
            0.0, //
            bend * dt,
            0.0,
            0.0,
            slope,
        );
        let mean = Vector4::new(z, slope * dx, slope * dy, slope * dt);
        DepthChange {
            x_px: self.x_px,
            y_px: self.y_px,
            depth: self.disparity.propagate(mean, &jacobian),
            flow: self.flow,
        }
    }
}

impl DepthTrack {
    /// Depth at t, gradient at t′ and Zt of (17), with their joint covariance; `bf` is b f. Needs d, d′ > 0.
    pub fn depth_change(&self, bf: f64) -> DepthChange {
        let [d, after, dx, dy] = self.disparity.mean.into();
        let slope = |d: f64| -bf / (d * d);
        let bend = 2.0 * bf / (after * after * after);
        let jacobian = Matrix4::new(
            slope(d),
            0.0,
            0.0,
            0.0, //
            0.0,
            bend * dx,
            slope(after),
            0.0, //
            0.0,
            bend * dy,
            0.0,
            slope(after), //
            -slope(d),
            slope(after),
            0.0,
            0.0,
        );
        let mean = Vector4::new(bf / d, slope(after) * dx, slope(after) * dy, bf / after - bf / d);
        DepthChange {
            x_px: self.x_px,
            y_px: self.y_px,
            depth: self.disparity.propagate(mean, &jacobian),
            flow: self.displacement,
        }
    }

    /// The differential observation that (47) silently takes it for: d at t, d_t = d′ − d, σ²_dt = 2 σ²_d.
    pub fn as_printed(&self) -> DepthFlow {
        let [d, after, dx, dy] = self.disparity.mean.into();
        let var = self.disparity.cov.diagonal();
        DepthFlow {
            x_px: self.x_px,
            y_px: self.y_px,
            disparity: Gaussian::independent([d, dx, dy, after - d], [var[0], var[2], var[3], 2.0 * var[0]]),
            flow: self.displacement,
        }
    }
}

impl StereoFlow {
    /// Δv = v_x left − v_x right, the rate of disparity, in pixels per interval.
    pub fn disparity_rate(&self) -> f64 {
        self.measured.mean[1] - self.measured.mean[3]
    }
}

impl StereoTrack {
    /// Take known errors of a rig away.
    pub(crate) fn correct(&mut self, errors: &RigErrors, rig: &StereoRig) {
        for end in [&mut self.before, &mut self.after] {
            end.mean = errors.corrected(&end.mean, rig);
        }
    }

    /// The flow that the discrete DV method works with: displacement, and Δv → (d′ − d) Z′/Z.
    pub fn discrete_flow(&self) -> StereoFlow {
        let (a, b) = (self.before.mean, self.after.mean);
        let ratio = a.z / b.z;
        let shift = b - a;
        let mean = Vector4::new(a.z, shift.x, shift.y, shift.x - shift.z * ratio);
        // Derivatives of (d, v_x, v_y, v_x right) by (x, y, d) before and after.
        let mut before = SMatrix::<f64, 4, 3>::zeros();
        let mut after = SMatrix::<f64, 4, 3>::zeros();
        before[(0, 2)] = 1.0;
        for (row, column) in [(1, 0), (2, 1), (3, 0)] {
            before[(row, column)] = -1.0;
            after[(row, column)] = 1.0;
        }
        before[(3, 2)] = ratio - shift.z / b.z;
        after[(3, 2)] = -ratio * ratio;
        self.flow_at(a, mean, &before, &after)
    }

    /// The differential observation at the middle of the interval, where the differences of one
    /// interval are central ones and the error of taking them for velocities is of third order.
    pub fn midpoint_flow(&self) -> StereoFlow {
        let (a, b) = (self.before.mean, self.after.mean);
        let shift = b - a;
        let mean = Vector4::new(0.5 * (a.z + b.z), shift.x, shift.y, shift.x - shift.z);
        let mut before = SMatrix::<f64, 4, 3>::zeros();
        let mut after = SMatrix::<f64, 4, 3>::zeros();
        before[(0, 2)] = 0.5;
        after[(0, 2)] = 0.5;
        for (row, column) in [(1, 0), (2, 1), (3, 0)] {
            before[(row, column)] = -1.0;
            after[(row, column)] = 1.0;
        }
        before[(3, 2)] = 1.0;
        after[(3, 2)] = -1.0;
        self.flow_at(0.5 * (a + b), mean, &before, &after)
    }

    fn flow_at(
        &self,
        at: Vector3<f64>,
        mean: Vector4<f64>,
        before: &SMatrix<f64, 4, 3>,
        after: &SMatrix<f64, 4, 3>,
    ) -> StereoFlow {
        let cov = before * self.before.cov * before.transpose() + after * self.after.cov * after.transpose();
        StereoFlow { x_px: at.x, y_px: at.y, measured: Gaussian { mean, cov } }
    }
}
