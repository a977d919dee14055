//! What a pixel would do as part of a rigid scene, and whether it does.

use nalgebra::{Matrix2, Matrix3, Matrix6, SMatrix, Vector2, Vector3, Vector6};

use super::depth_velocity::DepthVelocity;
use crate::geometry::distribution::CHI2_2_P9973;
use crate::geometry::{Gaussian, RIG_ERRORS, RigErrors, RigidMotion, StereoRig, Twist};

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
    /// The rig's errors that are not certain.
    rig_errors: [SharedError; RIG_ERRORS],
    /// How many of them there are: the first ones of the list.
    uncertain: usize,
}

/// An error of the rig, of the size of its standard deviation: what it does to disparity and to the motion.
#[derive(Debug, Clone, Copy)]
struct SharedError {
    /// Which of [`RigErrors`] it is.
    number: usize,
    sigma: f64,
    /// δ, and (δtZ, δΩX, δΩY) of it.
    motion: Vector6<f64>,
    depth: Vector3<f64>,
}

/// How certain a rig is, and how φ̂ answers to its errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigUncertainty {
    /// Standard deviations of the errors.
    pub sigma: RigErrors,
    /// ∂φ̂/∂errors, 6×8.
    pub phi_per_error: SMatrix<f64, 6, RIG_ERRORS>,
}

impl RigUncertainty {
    /// Of a rig that is exactly as stated.
    pub fn none() -> Self {
        Self { sigma: RigErrors::default(), phi_per_error: SMatrix::zeros() }
    }
}

impl<'a> RigidPrediction<'a> {
    /// Predict with φ ± what is new in its pair; `None` where some component of φ is unknown.
    ///
    /// The rig's errors move φ and every pixel's own disparity together.
    pub fn new(phi: &Gaussian<6>, uncertainty: &RigUncertainty, rig: &'a StereoRig) -> Option<Self> {
        let twist = Twist::from_vector(&phi.mean);
        // exp(φ + dφ) = exp(J dφ) exp(φ).
        let phi_jacobian = twist.left_jacobian();
        let motion_cov = phi_jacobian * phi.cov * phi_jacobian.transpose();
        let sigma = uncertainty.sigma.vector();
        let of = |number: usize| {
            let motion = phi_jacobian * uncertainty.phi_per_error.column(number) * sigma[number];
            let depth = motion.fixed_rows::<3>(2).into();
            SharedError { number, sigma: sigma[number], motion, depth }
        };
        // Those that are certain come last.
        let mut rig_errors: [SharedError; RIG_ERRORS] = std::array::from_fn(of);
        rig_errors.sort_by_key(|error| error.sigma == 0.0);
        let uncertain = rig_errors.iter().filter(|error| error.sigma > 0.0).count();
        phi.cov.iter().all(|v| v.is_finite()).then(|| Self {
            rig,
            motion: twist.exp(),
            motion_cov,
            cov: motion_cov.fixed_view::<3, 3>(2, 2).into(),
            rig_errors,
            uncertain,
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
        let mut cov = cov + flow_jacobian * self.motion_cov * flow_jacobian.transpose();
        let place_jacobian = RigErrors::jacobian(xyd, self.rig);
        for error in &self.rig_errors[..self.uncertain] {
            let disparity = place_jacobian[(2, error.number)] * error.sigma;
            let flow_by_error = flow_jacobian * error.motion + flow_by_d * disparity;
            cov += flow_by_error * flow_by_error.transpose();
        }
        outside(&apart, &cov)
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
        let mut z_variance = z_by_d * z_by_d * var;
        let mut cross = z_by_d * vz_by_d * var;
        let mut vz_variance = vz_by_d * vz_by_d * var + quadratic(&self.cov, moved.y, -moved.x);
        // The rig's errors move φ and this pixel's own disparity together.
        let disparity_by_error = self.disparity_by_error(p, d);
        for error in &self.rig_errors[..self.uncertain] {
            let disparity = disparity_by_error[error.number] * error.sigma;
            let by_motion = error.depth.x + moved.y * error.depth.y - moved.x * error.depth.z;
            let (z, vz) = (z_by_d * disparity, by_motion + vz_by_d * disparity);
            z_variance += z * z;
            cross += z * vz;
            vz_variance += vz * vz;
        }
        let cov = Matrix2::new(z_variance, cross, cross, vz_variance);
        DepthVelocity { z_vz: Gaussian { mean: Vector2::new(p.z, moved.z - p.z), cov } }
    }
}

impl RigidPrediction<'_> {
    /// ∂d/∂errors of [`RigErrors::jacobian`], of the point P whose disparity is d.
    #[inline(always)]
    fn disparity_by_error(&self, p: &Vector3<f64>, d: f64) -> [f64; RIG_ERRORS] {
        let (f, per_depth) = (self.rig.focal_px, p.z.recip());
        let (x, y) = ((p.x - self.rig.baseline_m) * per_depth, p.y * per_depth);
        [-f * (1.0 + x * x), f * x * y, f * y, -f * x, d, 0.0, 0.0, d]
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
        let rigid = RigidPrediction::new(&phi, &RigUncertainty::none(), &rig).unwrap();
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
        let vague = RigidPrediction::new(&vague, &RigUncertainty::none(), &rig).unwrap();
        assert!(!vague.contradicts_flow(&xyd, 0.0, &flow(across * 0.4)));
    }
}
