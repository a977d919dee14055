//! VZ of one pixel by the paper's four methods, and by the un-linearised (6), each with its variance.

use nalgebra::{Vector2, Vector4};

use crate::geometry::{Field, Gaussian, StereoRig, Twist};
use crate::observe::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};

/// VZ = Zx v_x + Zy v_y + Zt in metres per interval: (7) of a [`DepthFlow`], (17) of a [`DepthTrack`].
///
/// Its variance is (39c) and (47c): the shared disparity is accounted for.
pub fn dcce(change: &DepthChange) -> Gaussian<1> {
    let [_, zx, zy, zt] = change.depth.mean.into();
    let [vx, vy] = change.flow.mean.into();
    let (by_depth, by_flow) = (Vector4::new(0.0, vx, vy, 1.0), Vector2::new(zx, zy));
    let variance = by_depth.dot(&(change.depth.cov * by_depth)) + by_flow.dot(&(change.flow.cov * by_flow));
    Gaussian::scalar(zx * vx + zy * vy + zt, variance)
}

/// Variance of (7) as printed in (39): Zx, Zy and Zt taken as independent; `bf` is b f.
pub fn dcce_variance_as_printed(flow: &DepthFlow, bf: f64) -> f64 {
    let mut change = flow.depth_change(bf);
    change.depth = change.depth.without_correlation();
    dcce(&change).variance()
}

/// Variance of (17) as printed in (47); `bf` is b f.
pub fn dcce_discrete_variance_as_printed(track: &DepthTrack, bf: f64) -> f64 {
    dcce_variance_as_printed(&track.as_printed(), bf)
}

/// Coefficients (of σ²_d, of σ²_v) in the variance of (7), equation (53), with σ²_di = ½ σ²_d; `bf` is b f.
pub fn dcce_coefficients(flow: &DepthFlow, bf: f64) -> (f64, f64) {
    let part = |disparity: [f64; 4], v: [f64; 2]| {
        let with = DepthFlow {
            disparity: Gaussian::independent(flow.disparity.mean.into(), disparity),
            flow: Gaussian::independent(flow.flow.mean.into(), v),
            ..*flow
        };
        dcce_variance_as_printed(&with, bf)
    };
    (part([1.0, 0.5, 0.5, 0.5], [0.0; 2]), part([0.0; 4], [1.0; 2]))
}

/// VZ = −(Z²/(b f)) Δv in metres per interval, (9), with variance (44); `bf` is b f.
pub fn dv(flow: &StereoFlow, bf: f64) -> Gaussian<1> {
    let d = flow.measured.mean[0];
    let slope = -bf / (d * d);
    let vz = slope * flow.disparity_rate();
    let gradient = Vector4::new(-2.0 * vz / d, slope, 0.0, -slope);
    Gaussian::scalar(vz, gradient.dot(&(flow.measured.cov * gradient)))
}

/// Coefficients (of σ²_d, of σ²_v) in the variance of (9), equation (53), with σ_v alike left and right; `bf` is b f.
pub fn dv_coefficients(flow: &StereoFlow, bf: f64) -> (f64, f64) {
    let part = |variances: [f64; 4]| {
        let measured = Gaussian::independent(flow.measured.mean.into(), variances);
        dv(&StereoFlow { measured, ..*flow }, bf).variance()
    };
    (part([1.0, 0.0, 0.0, 0.0]), part([0.0, 1.0, 1.0, 1.0]))
}

/// VZ = −(Z Z′/(b f)) (d′ − d), which is Z′ − Z, in metres per interval, (21), with variance (50); `bf` is b f.
pub fn dv_discrete(track: &StereoTrack, bf: f64) -> Gaussian<1> {
    let (d, after) = (track.before.mean.z, track.after.mean.z);
    let variance = (bf / (d * d)).powi(2) * track.before.cov[(2, 2)]
        + (bf / (after * after)).powi(2) * track.after.cov[(2, 2)];
    Gaussian::scalar(-bf / (d * after) * (after - d), variance)
}

/// Variance of (21) as printed in (49), which takes Z, Z′, d and d′ as independent; `bf` is b f.
pub fn dv_discrete_variance_as_printed(track: &StereoTrack, bf: f64) -> f64 {
    let (d, after) = (track.before.mean.z, track.after.mean.z);
    let (z, z_after, step) = (bf / d, bf / after, after - d);
    let (var, var_after) = (track.before.cov[(2, 2)], track.after.cov[(2, 2)]);
    let depth_variance = |z: f64, var: f64| z.powi(4) / (bf * bf) * var;
    ((z_after * step).powi(2) * depth_variance(z, var)
        + (z * step).powi(2) * depth_variance(z_after, var_after)
        + (z * z_after).powi(2) * (var + var_after))
        / (bf * bf)
}

/// VZ = Z(x + vx, y + vy, t + 1) − Z(x, y, t), the exact change of depth, (6).
///
/// `z_m` is Z at t; `after` holds the disparity at t + 1 on pixels, and (`u`, `v`) is where the point
/// has moved to, in pixels. Disparity is interpolated, not Z. `None` where it is missing.
pub fn exact_change(z_m: f64, after: &Field, u: f64, v: f64, rig: &StereoRig) -> Option<f64> {
    Some(rig.depth(after.sample(u, v)?)? - z_m)
}

/// VZ of the point (x, y, d) as part of the rigid scene moving by φ: Z′ − Z over the interval, in metres.
///
/// `sigma_d` is the standard deviation of d. The covariance of φ and that of d are both propagated.
pub fn rigid(
    xyd: &nalgebra::Vector3<f64>,
    sigma_d: f64,
    phi: &Gaussian<6>,
    rig: &StereoRig,
) -> Option<Gaussian<1>> {
    let p = rig.point(xyd)?;
    let twist = Twist::from_vector(&phi.mean);
    let motion = twist.exp();
    let moved = motion.apply(&p);
    let by_delta = crate::geometry::RigidMotion::point_jacobian(&moved).row(2).into_owned();
    let by_phi = by_delta * twist.left_jacobian();
    let by_d = (motion.rotation.row(2) * rig.point_jacobian(xyd))[2] - rig.point_jacobian(xyd)[(2, 2)];
    let variance = (by_phi * phi.cov * by_phi.transpose())[0] + (by_d * sigma_d).powi(2);
    Some(Gaussian::scalar(moved.z - p.z, variance))
}

/// Smallest change of depth that a disparity step δ shows at disparity d, ΔZ = −Z/(1 + d/δ) in metres, (51).
pub fn smallest_change(d: f64, step: f64, bf: f64) -> f64 {
    -bf / d / (1.0 + d / step)
}
