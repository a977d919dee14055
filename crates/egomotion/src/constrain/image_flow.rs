//! The image flow constraint, equation (3), in x and in y.

use nalgebra::{Vector2, Vector3};

use super::linear::LinearConstraint;
use crate::geometry::{StereoRig, Twist};
use crate::observe::StereoFlow;

/// Equation (3) in pixels, for v_x and v_y of the left camera. Needs d > 0.
///
/// σ is that of each residual under the motion `at`, with the noise of d that enters through Z.
pub fn constraints(flow: &StereoFlow, rig: &StereoRig, at: &Twist) -> [LinearConstraint; 2] {
    let (x, y, f) = (flow.x_px, flow.y_px, rig.focal_px);
    let d = flow.measured.mean[0];
    let z = rig.depth_disparity_product() / d;
    let point = Vector3::new(x, y, f) * (z / f);
    // The translational part of the flow is proportional to d.
    let flow_by_d =
        Vector2::new(f * at.t.x - x * at.t.z, f * at.t.y - y * at.t.z) / rig.depth_disparity_product();
    let cov = &flow.measured.cov;
    let sigma =
        |i: usize, k: f64| (cov[(i, i)] - 2.0 * k * cov[(0, i)] + k * k * cov[(0, 0)]).max(0.0).sqrt();
    [
        LinearConstraint {
            point,
            normal: Vector3::new(f, 0.0, -x) / z,
            rate: flow.measured.mean[1],
            sigma: sigma(1, flow_by_d.x),
        },
        LinearConstraint {
            point,
            normal: Vector3::new(0.0, f, -y) / z,
            rate: flow.measured.mean[2],
            sigma: sigma(2, flow_by_d.y),
        },
    ]
}
