//! The binocular flow constraint (DV), equations (13) and (14).

use nalgebra::{Vector3, Vector4};

use super::linear::LinearConstraint;
use crate::geometry::{StereoRig, Twist};
use crate::observe::StereoFlow;

/// Equation (13) in metres: (0, 0, 1) · V(P) = −(Z²/(b f)) Δv. Needs d > 0.
///
/// σ is that of the residual under the motion `at`: d enters through Z² and through P.
pub fn constraint(flow: &StereoFlow, rig: &StereoRig, at: &Twist) -> LinearConstraint {
    let (bf, f) = (rig.depth_disparity_product(), rig.focal_px);
    let d = flow.measured.mean[0];
    let (z, slope) = (bf / d, bf / (d * d));
    let rate = -slope * flow.disparity_rate();
    let turning = (at.omega.x * flow.y_px - at.omega.y * flow.x_px) / f;
    let gradient = Vector4::new(-2.0 * rate / d + turning * slope, -slope, 0.0, slope);
    LinearConstraint {
        point: Vector3::new(flow.x_px, flow.y_px, f) * (z / f),
        normal: Vector3::z(),
        rate,
        sigma: gradient.dot(&(flow.measured.cov * gradient)).max(0.0).sqrt(),
    }
}

/// The same as printed in (14), in 1/m: (13) times −1/Z².
pub fn constraint_as_printed(flow: &StereoFlow, rig: &StereoRig, at: &Twist) -> LinearConstraint {
    let row = constraint(flow, rig, at);
    row.scaled(-1.0 / (row.point.z * row.point.z))
}
