//! The depth change constraint, equation (11).

use nalgebra::{Vector3, Vector4};

use super::linear::LinearConstraint;
use crate::geometry::{Twist, image_flow};
use crate::observe::DepthChange;

/// Equation (11) in metres: (f Zx, f Zy, −(Z + x Zx + y Zy))/Z · V(P) = −Zt.
///
/// The flow plays no part. σ is that of the whole residual under the motion `at`, because the
/// regressors Z, Zx, Zy are as noisy as Zt; at no motion it is that of Zt alone.
pub fn constraint(change: &DepthChange, focal_px: f64, at: &Twist) -> LinearConstraint {
    let (x, y, f) = (change.x_px, change.y_px, focal_px);
    let [z, zx, zy, zt] = change.depth.mean.into();
    let gradient = residual_gradient(change, f, at);
    LinearConstraint {
        point: Vector3::new(x, y, f) * (z / f),
        normal: Vector3::new(f * zx, f * zy, -(z + x * zx + y * zy)) / z,
        rate: -zt,
        sigma: gradient.dot(&(change.depth.cov * gradient)).max(0.0).sqrt(),
    }
}

/// Derivative of Zx v_x(φ) + Zy v_y(φ) + Zt − VZ(φ), which is (11)'s residual, by (Z, Zx, Zy, Zt).
fn residual_gradient(change: &DepthChange, f: f64, at: &Twist) -> Vector4<f64> {
    let (x, y) = (change.x_px, change.y_px);
    let [z, zx, zy, _] = change.depth.mean.into();
    let v = image_flow(at, x, y, z, f);
    let flow_by_depth = -(zx * (f * at.t.x - x * at.t.z) + zy * (f * at.t.y - y * at.t.z)) / (z * z);
    let vz_by_depth = (at.omega.x * y - at.omega.y * x) / f;
    Vector4::new(flow_by_depth - vz_by_depth, v.x, v.y, 1.0)
}
