//! φ = (t, Ω), the rigid motion exp(φ) it generates, and the way back.
//!
//! φ is *scene motion*: the velocity of the points relative to the camera, Ṗ = t + Ω × P.
//! The camera's own motion is the inverse; [`RigidMotion::inverse`] is the one place to turn it.

use nalgebra::{Matrix3, Matrix6, Rotation3, SMatrix, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// Six parameters of rigid scene motion over one frame interval (or per second where a name says so).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Translational velocity t, in metres per interval.
    pub t: Vector3<f64>,
    /// Angular velocity Ω, in radians per interval.
    pub omega: Vector3<f64>,
}

/// A finite rigid motion P′ = R P + T, equation (5).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RigidMotion {
    /// Rotation R.
    pub rotation: Matrix3<f64>,
    /// Translation T, in metres.
    pub translation: Vector3<f64>,
}

impl Twist {
    /// φ from (tX, tY, tZ, ΩX, ΩY, ΩZ).
    pub fn from_vector(phi: &Vector6<f64>) -> Self {
        Self { t: phi.fixed_rows::<3>(0).into(), omega: phi.fixed_rows::<3>(3).into() }
    }

    /// No motion.
    pub fn zero() -> Self {
        Self { t: Vector3::zeros(), omega: Vector3::zeros() }
    }

    /// (tX, tY, tZ, ΩX, ΩY, ΩZ).
    pub fn vector(&self) -> Vector6<f64> {
        Vector6::new(self.t.x, self.t.y, self.t.z, self.omega.x, self.omega.y, self.omega.z)
    }

    /// φ Δt.
    pub fn scaled(&self, dt: f64) -> Self {
        Self { t: self.t * dt, omega: self.omega * dt }
    }

    /// Velocity of a point, V = t + Ω × P, equation (1).
    pub fn velocity(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.t + self.omega.cross(p)
    }

    /// The same motion seen by a parallel camera centred at `centre`: t + Ω × c, Ω, equation (4).
    pub fn seen_from(&self, centre: &Vector3<f64>) -> Self {
        Self { t: self.velocity(centre), omega: self.omega }
    }

    /// The matrix of [`Twist::seen_from`] acting on (t, Ω), to carry covariances along, 6×6.
    pub fn seen_from_matrix(centre: &Vector3<f64>) -> Matrix6<f64> {
        let mut m = Matrix6::identity();
        m.fixed_view_mut::<3, 3>(0, 3).copy_from(&-centre.cross_matrix());
        m
    }

    /// exp(φ): the motion after one interval at constant φ, equations (24)–(26) with Δt = 1.
    pub fn exp(&self) -> RigidMotion {
        let (rotation, u) = self.rotation_and_u(1.0);
        RigidMotion { rotation, translation: u * self.t }
    }

    /// R and U of equations (25), (26) after the time `dt`; T = U t.
    pub fn rotation_and_u(&self, dt: f64) -> (Matrix3<f64>, Matrix3<f64>) {
        let w = (self.omega * dt).cross_matrix();
        let (a, b, c) = rodrigues_coefficients(self.omega.norm() * dt.abs());
        let r = Matrix3::identity() + a * w + b * (w * w);
        let u = dt * (Matrix3::identity() + b * w + c * (w * w));
        (r, u)
    }

    /// Left Jacobian of exp at φ, 6×6: exp(φ + δ) = exp(J δ) exp(φ) to first order.
    pub fn left_jacobian(&self) -> Matrix6<f64> {
        // Σ ad(φ)ⁿ/(n + 1)!; converges for every φ and needs no special case at 0 or π.
        let mut ad = Matrix6::zeros();
        let (w, t) = (self.omega.cross_matrix(), self.t.cross_matrix());
        ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&w);
        ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&w);
        ad.fixed_view_mut::<3, 3>(0, 3).copy_from(&t);
        let (mut sum, mut term) = (Matrix6::identity(), Matrix6::identity());
        for n in 1..60 {
            term = term * ad / f64::from(n + 1);
            sum += term;
            if term.norm() < 1e-17 * sum.norm() {
                break;
            }
        }
        sum
    }
}

/// sin θ/θ, (1 − cos θ)/θ², (θ − sin θ)/θ³, by their series near zero.
fn rodrigues_coefficients(theta: f64) -> (f64, f64, f64) {
    let s = theta * theta;
    if theta < 0.1 {
        let a = 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0)));
        let b = 0.5 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0))));
        let c = (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))) / 6.0;
        (a, b, c)
    } else {
        let half = (0.5 * theta).sin();
        (theta.sin() / theta, 2.0 * half * half / s, (theta - theta.sin()) / (s * theta))
    }
}

impl RigidMotion {
    /// No motion.
    pub fn identity() -> Self {
        Self { rotation: Matrix3::identity(), translation: Vector3::zeros() }
    }

    /// R P + T, equation (5).
    #[inline(always)]
    pub fn apply(&self, p: &Vector3<f64>) -> Vector3<f64> {
        let (r, t) = (&self.rotation, &self.translation);
        Vector3::new(
            r.m11 * p.x + r.m12 * p.y + r.m13 * p.z + t.x,
            r.m21 * p.x + r.m22 * p.y + r.m23 * p.z + t.y,
            r.m31 * p.x + r.m32 * p.y + r.m33 * p.z + t.z,
        )
    }

    /// `self` after `first`: c_from_a = c_from_b.after(&b_from_a).
    pub fn after(&self, first: &Self) -> Self {
        Self { rotation: self.rotation * first.rotation, translation: self.apply(&first.translation) }
    }

    /// The inverse motion: a_from_b of b_from_a.
    pub fn inverse(&self) -> Self {
        let back = self.rotation.transpose();
        Self { rotation: back, translation: -(back * self.translation) }
    }

    /// Ad of this motion, 6×6: exp(Ad δ) after this motion is this motion after exp(δ).
    pub fn adjoint(&self) -> Matrix6<f64> {
        let mut adjoint = Matrix6::zeros();
        adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.rotation);
        adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.rotation);
        adjoint.fixed_view_mut::<3, 3>(0, 3).copy_from(&(self.translation.cross_matrix() * self.rotation));
        adjoint
    }

    /// The rotation as a unit quaternion.
    pub fn quaternion(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.rotation))
    }

    /// φ with exp(φ) equal to this motion: the constant velocities over one interval, (25)–(28).
    ///
    /// Stable near zero and near π, because the angle is read from a quaternion.
    pub fn log(&self) -> Twist {
        let q = self.quaternion();
        let (imag, real) = (q.imag() * q.scalar().signum(), q.scalar().abs());
        let sine = imag.norm();
        let theta = 2.0 * sine.atan2(real);
        // θ / sin(θ/2), which tends to 2.
        let omega = imag * if sine > 1e-8 { theta / sine } else { 2.0 / real };
        let w = omega.cross_matrix();
        // (1 − (θ/2) cot(θ/2))/θ², which tends to 1/12.
        let k = if theta < 1e-2 {
            let s = theta * theta;
            (1.0 + s / 60.0 * (1.0 + s / 42.0)) / 12.0
        } else {
            (1.0 - 0.5 * theta * real / sine) / (theta * theta)
        };
        let t = self.translation - 0.5 * (w * self.translation) + k * (w * (w * self.translation));
        Twist { t, omega }
    }

    /// Velocities by the instantaneous form (27), R ≈ I + \[Ω\]: the antisymmetric part, and T itself.
    pub fn instantaneous(&self) -> Twist {
        let r = &self.rotation;
        let omega = 0.5 * Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]);
        Twist { t: self.translation, omega }
    }

    /// The nearest rotation to a 3×3 matrix in the Frobenius norm, by SVD; `None` if it has none.
    pub fn nearest_rotation(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        let svd = m.try_svd(true, true, f64::EPSILON, 200)?;
        let (u, vt) = (svd.u?, svd.v_t?);
        let turn = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * vt).determinant().signum()));
        Some(u * turn * vt)
    }

    /// ∂(exp(δ) P)/∂δ at δ = 0 for the moved point P: \[I, −\[P\]×\], 3×6.
    pub fn point_jacobian(p: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
        let mut j = SMatrix::<f64, 3, 6>::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-p.cross_matrix());
        j
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twists() -> Vec<Twist> {
        let axis = Vector3::new(0.3, -0.5, 0.8).normalize();
        let t = Vector3::new(0.4, -1.0, 2.0);
        [0.0, 1e-12, 1e-9, 1e-5, 0.0999, 0.1001, 1.0, 3.0, 3.1, std::f64::consts::PI - 1e-9]
            .map(|theta| Twist { t, omega: axis * theta })
            .to_vec()
    }

    #[test]
    fn log_inverts_exp_from_zero_to_pi() {
        for phi in twists() {
            let back = phi.exp().log();
            assert!((back.vector() - phi.vector()).norm() < 1e-9, "{phi:?} {back:?}");
        }
    }

    #[test]
    fn left_jacobian_matches_differences() {
        for phi in twists().into_iter().filter(|p| p.omega.norm() < 3.0) {
            let jacobian = phi.left_jacobian();
            for k in 0..6 {
                let mut step = Vector6::zeros();
                step[k] = 1e-6;
                let moved = |s: f64| Twist::from_vector(&(phi.vector() + s * step)).exp();
                let delta = moved(1.0).after(&moved(-1.0).inverse()).log().vector() / 2e-6;
                assert!((delta - jacobian.column(k)).norm() < 1e-8, "{phi:?} {k}");
            }
        }
    }

    #[test]
    fn the_adjoint_carries_a_small_motion_across() {
        let (motion, delta) = (twists()[6].exp(), twists()[4]);
        let across = Twist::from_vector(&(motion.adjoint() * delta.vector()));
        let (left, right) = (across.exp().after(&motion), motion.after(&delta.exp()));
        assert!((left.translation - right.translation).norm() < 1e-12);
        assert!((left.rotation - right.rotation).norm() < 1e-12);
    }

    #[test]
    fn composition_and_inverse() {
        let (a, b) = (twists()[6].exp(), twists()[5].exp());
        let p = Vector3::new(1.0, 2.0, 3.0);
        assert!((a.after(&b).apply(&p) - a.apply(&b.apply(&p))).norm() < 1e-12);
        assert!((a.inverse().apply(&a.apply(&p)) - p).norm() < 1e-12);
    }
}
