//! VZ of one pixel by the paper's four methods, by the un-linearised (6), and as part of a rigid scene.

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3, Vector4};

use crate::geometry::distribution::CHI2_1_P9973;
use crate::geometry::{Field, Gaussian, StereoRig};
use crate::observe::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};

/// Depth and depth velocity of one pixel, with their joint covariance.
///
/// The two share the noise of disparity, so time to impact needs them together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthVelocity {
    /// (Z, VZ): depth at t in metres, its change in metres per interval.
    pub z_vz: Gaussian<2>,
}

impl DepthVelocity {
    /// VZ with its variance, in metres per interval; negative approaches.
    pub fn vz(&self) -> Gaussian<1> {
        Gaussian::scalar(self.z_vz.mean.y, self.z_vz.cov[(1, 1)])
    }

    /// Looming −VZ/(Z′ Δt) at the later frame, in 1/s, with Z′ = Z + VZ; `None` unless Z′ > 0.
    pub fn looming(&self, dt_s: f64) -> Option<Gaussian<1>> {
        let later = self.z_vz.mean.x + self.z_vz.mean.y;
        (later > 0.0).then(|| self.looming_in_front(dt_s))
    }

    /// [`DepthVelocity::looming`] where Z′ is known to be positive.
    #[inline(always)]
    pub(crate) fn looming_in_front(&self, dt_s: f64) -> Gaussian<1> {
        let [z, vz] = self.z_vz.mean.into();
        let (cov, per_later) = (&self.z_vz.cov, (z + vz).recip());
        // −VZ/Z′ = Z/Z′ − 1, whose gradient by (Z, VZ) is (VZ, −Z)/Z′².
        let (looming_by_z, looming_by_vz) = (vz * per_later * per_later, -z * per_later * per_later);
        let variance = looming_by_z * looming_by_z * cov.m11
            + 2.0 * looming_by_z * looming_by_vz * cov.m12
            + looming_by_vz * looming_by_vz * cov.m22;
        Gaussian::scalar(-vz * per_later / dt_s, variance / (dt_s * dt_s))
    }

    /// The same with Z at the beginning of the interval, of one that holds Z at its middle.
    ///
    /// Differential observations are taken half-way along the motion, Z_mid = Z + VZ/2.
    pub(crate) fn at_interval_start(self) -> Self {
        let [z_middle, vz] = self.z_vz.mean.into();
        let back = Matrix2::new(1.0, -0.5, 0.0, 1.0);
        Self { z_vz: self.z_vz.propagate(Vector2::new(z_middle - 0.5 * vz, vz), &back) }
    }

    /// From disparity before and after (d, d′) and their joint covariance; `bf` is b f. Needs d, d′ > 0.
    #[inline(always)]
    pub fn from_disparities(disparities: &Gaussian<2>, bf: f64) -> Self {
        let [d, after] = disparities.mean.into();
        let jacobian = Matrix2::new(-bf / (d * d), 0.0, bf / (d * d), -bf / (after * after));
        let mean = Vector2::new(bf / d, -bf / (d * after) * (after - d));
        Self { z_vz: disparities.propagate(mean, &jacobian) }
    }
}

/// VZ = Zx v_x + Zy v_y + Zt: (7) of a [`DepthFlow`], (17) of a [`DepthTrack`].
///
/// Its variance is (39c) and (47c): the shared disparity is accounted for.
pub fn dcce(change: &DepthChange) -> DepthVelocity {
    let [z, zx, zy, zt] = change.depth.mean.into();
    let [vx, vy] = change.flow.mean.into();
    let depth_jacobian = SMatrix::<f64, 2, 4>::from_rows(&[
        Vector4::x().transpose(),
        Vector4::new(0.0, vx, vy, 1.0).transpose(),
    ]);
    let vz_by_flow = Vector2::new(zx, zy);
    let mut z_vz = change.depth.propagate(Vector2::new(z, zx * vx + zy * vy + zt), &depth_jacobian);
    z_vz.cov[(1, 1)] += vz_by_flow.dot(&(change.flow.cov * vz_by_flow));
    DepthVelocity { z_vz }
}

/// Variance of VZ of [`dcce`] with the product of its two noises, in m² per interval²: (39c) or (47c)
/// plus tr(Σ_g Σ_v), where g = (Zx, Zy) and v is the flow.
///
/// A noisy gradient times a noisy flow is of second order, and yet not small: with σ²_di = ½ σ²_d it adds up
/// to 2 σ²_v/(1 + |v|²) of (39c), 3 % at σ_v = 1/8 px and 50 % at 1/2 px where the image stands still, and
/// does not vanish with σ_d. For independent g and v the variance of g · v is then exact.
pub fn dcce_variance_with_product(change: &DepthChange) -> f64 {
    let gradient = change.depth.cov.fixed_view::<2, 2>(1, 1);
    dcce(change).vz().variance() + gradient.component_mul(&change.flow.cov).sum()
}

/// Variance of (7) as printed in (39): Zx, Zy and Zt taken as independent; `bf` is b f.
pub fn dcce_variance_as_printed(flow: &DepthFlow, bf: f64) -> f64 {
    let mut change = flow.depth_change(bf);
    change.depth = change.depth.without_correlation();
    dcce(&change).vz().variance()
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

/// Coefficients (of σ²_d, of σ²_v) in the variance of (17) as printed in (47), equation (53); `bf` is b f.
///
/// Gradients have σ²_di = ½ σ²_d and d_t = d′ − d has 2 σ²_d; σ²_v is the variance of one component of the displacement.
pub fn dcce_discrete_coefficients(track: &DepthTrack, bf: f64) -> (f64, f64) {
    let part = |disparity: [f64; 4], displacement: [f64; 2]| {
        let with = DepthTrack {
            disparity: Gaussian::independent(track.disparity.mean.into(), disparity),
            displacement: Gaussian::independent(track.displacement.mean.into(), displacement),
            ..*track
        };
        dcce_discrete_variance_as_printed(&with, bf)
    };
    (part([1.0, 1.0, 0.5, 0.5], [0.0; 2]), part([0.0; 4], [1.0; 2]))
}

/// VZ = −(Z²/(b f)) Δv, (9), with variance (44); `bf` is b f.
pub fn dv(flow: &StereoFlow, bf: f64) -> DepthVelocity {
    let d = flow.measured.mean[0];
    let slope = -bf / (d * d);
    let vz = slope * flow.disparity_rate();
    let jacobian = SMatrix::<f64, 2, 4>::new(
        slope,
        0.0,
        0.0,
        0.0, //
        -2.0 * vz / d,
        slope,
        0.0,
        -slope,
    );
    DepthVelocity { z_vz: flow.measured.propagate(Vector2::new(bf / d, vz), &jacobian) }
}

/// Coefficients (of σ²_d, of σ²_v) in the variance of (9), equation (53), with σ_v alike left and right; `bf` is b f.
pub fn dv_coefficients(flow: &StereoFlow, bf: f64) -> (f64, f64) {
    let part = |variances: [f64; 4]| {
        let measured = Gaussian::independent(flow.measured.mean.into(), variances);
        dv(&StereoFlow { measured, ..*flow }, bf).vz().variance()
    };
    (part([1.0, 0.0, 0.0, 0.0]), part([0.0, 1.0, 1.0, 1.0]))
}

/// VZ = −(Z Z′/(b f)) (d′ − d), which is Z′ − Z, (21), with variance (50); `bf` is b f.
pub fn dv_discrete(track: &StereoTrack, bf: f64) -> DepthVelocity {
    let disparities = Gaussian::independent(
        [track.before.mean.z, track.after.mean.z],
        [track.before.cov[(2, 2)], track.after.cov[(2, 2)]],
    );
    DepthVelocity::from_disparities(&disparities, bf)
}

/// Coefficients (of σ²_d, of σ²_v) in the variance of (21), equation (53), with σ_d alike before and after; `bf` is b f.
///
/// The second is 0: (21) takes no displacement.
pub fn dv_discrete_coefficients(track: &StereoTrack, bf: f64) -> (f64, f64) {
    let unit = |end: &Gaussian<3>| Gaussian { cov: Matrix3::from_diagonal(&Vector3::z()), ..*end };
    let with = StereoTrack { before: unit(&track.before), after: unit(&track.after) };
    (dv_discrete(&with, bf).vz().variance(), 0.0)
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

/// VZ = Z(x + vx, y + vy, t + 1) − Z(x, y, t), the exact change of depth, (6), in metres per interval.
///
/// `z_m` is Z at t; `after` holds the disparity d at t + 1 on pixels, and (`u`, `v`) is where the
/// point has moved to, in pixels. Disparity is interpolated, not Z. `None` where it is missing.
pub fn exact_change(z_m: f64, after: &Field, u: f64, v: f64, rig: &StereoRig) -> Option<f64> {
    Some(rig.depth(after.sample(u, v)?)? - z_m)
}

/// The rigid prediction where the measurement does not contradict it, else the measurement.
///
/// They contradict when they differ by more than three standard deviations of the difference: then
/// the pixel moves by itself.
pub(crate) fn rigid_unless_moving(
    measured: Option<DepthVelocity>,
    rigid: Option<DepthVelocity>,
) -> Option<DepthVelocity> {
    match (measured, rigid) {
        (Some(m), Some(r)) => Some(if contradict(&m, &r) { m } else { r }),
        (measured, rigid) => rigid.or(measured),
    }
}

/// Whether a measured VZ and the rigid one differ by more than three standard deviations of their difference.
#[inline(always)]
pub(crate) fn contradict(measured: &DepthVelocity, rigid: &DepthVelocity) -> bool {
    let (m, r) = (&measured.z_vz, &rigid.z_vz);
    let apart = m.mean.y - r.mean.y;
    apart * apart > CHI2_1_P9973 * (m.cov.m22 + r.cov.m22)
}

/// Smallest change of depth that a disparity step δ shows at disparity d, ΔZ = −Z/(1 + d/δ) in metres, (51).
pub fn smallest_change(d: f64, step: f64, bf: f64) -> f64 {
    -bf / d / (1.0 + d / step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_to_impact_counts_from_the_later_frame_wherever_z_was_measured() {
        // 2 m before, 1.9 m at the middle, 1.8 m after: nine more intervals to the camera.
        let cov = Matrix2::new(4e-4, 1e-4, 1e-4, 9e-4);
        let middle = DepthVelocity { z_vz: Gaussian { mean: Vector2::new(1.9, -0.2), cov } };
        let start = DepthVelocity { z_vz: Gaussian { mean: Vector2::new(2.0, -0.2), cov } };
        for velocity in [middle.at_interval_start(), start] {
            assert!((velocity.looming(0.1).unwrap().value() - 1.0 / 0.9).abs() < 1e-12);
        }
        // Var(Z − VZ/2) = 4e-4 − 1e-4 + 9e-4/4.
        assert!((middle.at_interval_start().z_vz.cov[(0, 0)] - 5.25e-4).abs() < 1e-15);
        assert_eq!(middle.at_interval_start().vz(), middle.vz());
    }
}
