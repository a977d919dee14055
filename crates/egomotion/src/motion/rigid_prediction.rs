//! What a pixel would do as part of a rigid scene, and whether it does.

use nalgebra::{Matrix2, Matrix3, Matrix6, Vector2, Vector3, Vector6};

use super::depth_velocity::DepthVelocity;
use crate::geometry::distribution::CHI2_2_P9973;
use crate::geometry::{Gaussian, RigidMotion, StereoRig, Twist};

/// The rigid motion φ with what every pixel's prediction shares.
///
/// A small motion δ = (δt, δΩ) after it changes the depth Z′ of a point (X′, Y′, Z′) by δtZ + Y′ δΩX − X′ δΩY:
/// only these three of its components matter.
#[derive(Debug, Clone, Copy)]
pub struct RigidPrediction<'a> {
    rig: &'a StereoRig,
    motion: RigidMotion,
    /// Covariance of δ, and of (δtZ, δΩX, δΩY).
    motion_cov: Matrix6<f64>,
    cov: Matrix3<f64>,
    /// Standard deviation of the offset of disparity, δ per pixel of it, and (δtZ, δΩX, δΩY) of that.
    offset_sigma_px: f64,
    motion_by_offset: Vector6<f64>,
    depth_by_offset: Vector3<f64>,
}

/// An unknown offset common to all disparities: what an imperfect calibration does to the rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisparityOffset {
    /// Its standard deviation, in pixels.
    pub sigma_px: f64,
    /// How φ changes per pixel of it.
    pub phi_per_px: Vector6<f64>,
}

impl DisparityOffset {
    /// A perfect calibration.
    pub fn none() -> Self {
        Self { sigma_px: 0.0, phi_per_px: Vector6::zeros() }
    }
}

impl<'a> RigidPrediction<'a> {
    /// Predict with φ ± its covariance; `None` where some component of φ is unknown.
    ///
    /// The offset makes the part of the variance that is calibration's.
    pub fn new(phi: &Gaussian<6>, offset: DisparityOffset, rig: &'a StereoRig) -> Option<Self> {
        let twist = Twist::from_vector(&phi.mean);
        // exp(φ + dφ) = exp(J dφ) exp(φ).
        let phi_jacobian = twist.left_jacobian();
        let motion_cov = phi_jacobian * phi.cov * phi_jacobian.transpose();
        let motion_by_offset = phi_jacobian * offset.phi_per_px;
        phi.cov.iter().all(|v| v.is_finite()).then(|| Self {
            rig,
            motion: twist.exp(),
            motion_cov,
            cov: motion_cov.fixed_view::<3, 3>(2, 2).into(),
            offset_sigma_px: offset.sigma_px,
            motion_by_offset,
            depth_by_offset: motion_by_offset.fixed_rows::<3>(2).into(),
        })
    }

    /// The rigid motion exp(φ).
    pub fn motion(&self) -> &RigidMotion {
        &self.motion
    }

    /// Where a point measured as (x, y, d) goes: (x′, y′, d′); `None` behind the camera.
    pub fn moved(&self, xyd: &Vector3<f64>) -> Option<Vector3<f64>> {
        self.rig.project(&self.motion.apply(&self.rig.point(xyd)?))
    }

    /// Whether a flow, in image coordinates, is not that of the still world's point (x, y, d).
    ///
    /// It is not where it lies outside the ellipse that holds 99.7 % of what the noise of flow, of d
    /// (`d_variance`), of φ and of the calibration make of that point.
    pub(crate) fn contradicts_flow(&self, xyd: &Vector3<f64>, d_variance: f64, flow: &Gaussian<2>) -> bool {
        let Some(predicted) = self.moved(xyd) else { return false };
        let Some(p) = self.rig.point(&predicted) else { return false };
        let apart = xyd.xy() + flow.mean - predicted.xy();
        // P is in proportion to 1/d.
        let flow_by_d = self.rig.projected_change(&p, &((p - self.motion.translation) / -xyd.z)).xy();
        let cov = flow.cov + flow_by_d * flow_by_d.transpose() * d_variance;
        if !outside(&apart, &cov) {
            return false;
        }
        let flow_jacobian = self.rig.velocity_jacobian(&predicted).fixed_rows::<2>(0).into_owned();
        let flow_by_offset = (flow_jacobian * self.motion_by_offset + flow_by_d) * self.offset_sigma_px;
        let motion_part = flow_jacobian * self.motion_cov * flow_jacobian.transpose();
        outside(&apart, &(cov + motion_part + flow_by_offset * flow_by_offset.transpose()))
    }

    /// Z and VZ of the still world's point (x, y, d), from the noise `sigma_d` of d and that of φ.
    pub fn depth_velocity(&self, xyd: &Vector3<f64>, sigma_d: f64) -> Option<DepthVelocity> {
        let p = self.rig.point(xyd)?;
        let velocity = self.depth_velocity_of(&p, xyd.z, sigma_d);
        (p.z + velocity.z_vz.mean.y > 0.0).then_some(velocity)
    }

    /// [`RigidPrediction::depth_velocity`] of a point whose disparity d is positive, whether or not it stays
    /// in front of the camera.
    #[inline(always)]
    pub(crate) fn depth_velocity_of(&self, p: &Vector3<f64>, d: f64, sigma_d: f64) -> DepthVelocity {
        let moved = self.motion.apply(p);
        let per_px = d.recip();
        // P is in proportion to 1/d, so ∂P/∂d = −P/d.
        let z_by_d = -p.z * per_px;
        let vz_by_d = (self.motion.translation.z - (moved.z - p.z)) * per_px;
        let var = sigma_d * sigma_d;
        // The offset moves φ and this pixel's own disparity together.
        let (offset_sigma, depth_by_offset) = (self.offset_sigma_px, &self.depth_by_offset);
        let z_by_offset = z_by_d * offset_sigma;
        let vz_by_offset = (depth_by_offset.x + moved.y * depth_by_offset.y - moved.x * depth_by_offset.z
            + vz_by_d)
            * offset_sigma;
        let cross = z_by_d * vz_by_d * var + z_by_offset * vz_by_offset;
        let cov = Matrix2::new(
            z_by_d * z_by_d * var + z_by_offset * z_by_offset,
            cross,
            cross,
            vz_by_d * vz_by_d * var + quadratic(&self.cov, moved.y, -moved.x) + vz_by_offset * vz_by_offset,
        );
        DepthVelocity { z_vz: Gaussian { mean: Vector2::new(p.z, moved.z - p.z), cov } }
    }
}

/// Whether eᵀ S⁻¹ e > χ²₂(0.9973).
fn outside(e: &Vector2<f64>, s: &Matrix2<f64>) -> bool {
    let q = e.x * e.x * s.m22 - 2.0 * e.x * e.y * s.m12 + e.y * e.y * s.m11;
    q > CHI2_2_P9973 * (s.m11 * s.m22 - s.m12 * s.m12)
}

/// vᵀ M v of v = (1, a, b) and a symmetric M.
#[inline(always)]
fn quadratic(m: &Matrix3<f64>, a: f64, b: f64) -> f64 {
    m.m11 + a * (2.0 * m.m12 + a * m.m22) + b * (2.0 * (m.m13 + a * m.m23) + b * m.m33)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flow_contradicts_where_no_noise_explains_it() {
        let rig = StereoRig::new(400.0, (159.5, 119.5), 0.2, (320, 240)).unwrap();
        let phi = Twist { t: Vector3::new(0.0, 0.0, -0.5), omega: Vector3::zeros() };
        let phi = Gaussian { mean: phi.vector(), cov: Matrix6::identity() * 1e-8 };
        let rigid = RigidPrediction::new(&phi, DisparityOffset::none(), &rig).unwrap();
        let xyd = Vector3::new(60.0, 40.0, 10.0);
        let still = (rigid.moved(&xyd).unwrap() - xyd).xy();
        let flow = |error: Vector2<f64>| Gaussian { mean: still + error, cov: Matrix2::identity() * 0.01 };
        let across = Vector2::new(-still.y, still.x).normalize();
        // Three and four standard deviations of flow: 3.44 is the radius of the ellipse.
        assert!(!rigid.contradicts_flow(&xyd, 0.0, &flow(across * 0.3)));
        assert!(rigid.contradicts_flow(&xyd, 0.0, &flow(across * 0.4)));
        // Along the epipolar line an uncertain disparity explains it.
        let along = still.normalize() * 0.4;
        assert!(rigid.contradicts_flow(&xyd, 0.0, &flow(along)));
        assert!(!rigid.contradicts_flow(&xyd, 1.0, &flow(along)));
        assert!(rigid.contradicts_flow(&xyd, 1.0, &flow(across * 0.4)));
        // An uncertain motion explains both.
        let vague = Gaussian { cov: Matrix6::identity() * 1e-4, ..phi };
        let vague = RigidPrediction::new(&vague, DisparityOffset::none(), &rig).unwrap();
        assert!(!vague.contradicts_flow(&xyd, 0.0, &flow(across * 0.4)));
    }
}
