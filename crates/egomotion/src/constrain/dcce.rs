//! The depth change constraint, equation (11).

use nalgebra::{SMatrix, Vector3, Vector4, Vector6};

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

/// Covariance of the row's coefficients and of its rate, (a, c) of a · φ = c, 7×7: the regressors are measured too.
pub fn row_noise(change: &DepthChange, focal_px: f64) -> SMatrix<f64, 7, 7> {
    let mut jacobian = SMatrix::<f64, 7, 4>::zeros();
    jacobian.fixed_view_mut::<6, 3>(0, 0).copy_from(&row_jacobian(change, focal_px));
    jacobian[(6, 3)] = -1.0;
    jacobian * change.depth.cov * jacobian.transpose()
}

/// ∂a/∂(Z, Zx, Zy) of the row a of (11), 6×3; c is −Zt.
pub(crate) fn row_jacobian(change: &DepthChange, focal_px: f64) -> SMatrix<f64, 6, 3> {
    let (x, y, f) = (change.x_px, change.y_px, focal_px);
    let [z, zx, zy, _] = change.depth.mean.into();
    // P = Z ray and a = (n, Z ray × n) with n = along − (0, 0, 1); `along` is in proportion to the gradient over Z.
    let ray = Vector3::new(x / f, y / f, 1.0);
    let (n_by_zx, n_by_zy) = (Vector3::new(f, 0.0, -x) / z, Vector3::new(0.0, f, -y) / z);
    let along = n_by_zx * zx + n_by_zy * zy;
    let column = |n: Vector3<f64>, m: Vector3<f64>| Vector6::new(n.x, n.y, n.z, m.x, m.y, m.z);
    SMatrix::from_columns(&[
        column(-along / z, -ray.cross(&Vector3::z())),
        column(n_by_zx, ray.cross(&n_by_zx) * z),
        column(n_by_zy, ray.cross(&n_by_zy) * z),
    ])
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, Vector4};

    use super::*;
    use crate::geometry::Gaussian;

    #[test]
    fn the_noise_of_a_row_is_by_its_numeric_jacobian() {
        let change = |depth: Vector4<f64>| DepthChange {
            x_px: 40.0,
            y_px: -31.0,
            depth: Gaussian { mean: depth, cov: Matrix4::identity() },
            flow: Gaussian::independent([0.0; 2], [1.0; 2]),
        };
        let row = |depth| constraint(&change(depth), 400.0, &Twist::zero()).row();
        let at = Vector4::new(2.5, 0.02, -0.03, 0.01);
        for k in 0..3 {
            let step = Vector4::ith(k, 1e-6);
            let numeric = (row(at + step) - row(at - step)) / 2e-6;
            assert!((numeric - row_jacobian(&change(at), 400.0).column(k)).amax() < 1e-7, "{k}");
        }
    }
}
