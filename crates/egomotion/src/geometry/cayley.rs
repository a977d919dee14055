//! A finite motion by Cayley's vector: what is linear, and exact, in the mean of a point's two places.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::twist::Twist;

/// Squared half length of w below which coefficients come from their series: both forms then keep ten digits and more.
const SERIES_BELOW: f64 = 1e-3;

/// A finite rigid motion as (τ, w): P′ − P = τ + w × ½ (P + P′), without approximation.
///
/// w points along the axis and is 2 tan(θ/2) long; τ = (I − ½\[w\]×) T. A turn by θ = π has no such form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CayleyMotion {
    /// τ, in metres.
    pub tau: Vector3<f64>,
    /// w, without unit; for small turns it is Ω.
    pub w: Vector3<f64>,
}

impl CayleyMotion {
    /// (τ, w) from six numbers.
    pub fn from_vector(tau_w: &Vector6<f64>) -> Self {
        Self { tau: tau_w.fixed_rows::<3>(0).into(), w: tau_w.fixed_rows::<3>(3).into() }
    }

    /// τX, τY, τZ, wX, wY, wZ.
    pub fn vector(&self) -> Vector6<f64> {
        Vector6::new(self.tau.x, self.tau.y, self.tau.z, self.w.x, self.w.y, self.w.z)
    }

    /// The motion exp(φ); not finite for a turn by π.
    pub fn from_twist(phi: &Twist) -> Self {
        let half = 0.5 * phi.omega.norm();
        let stretch = if half * half < SERIES_BELOW {
            let s = half * half;
            1.0 + s / 3.0 * (1.0 + s * 2.0 / 5.0 * (1.0 + s * 17.0 / 42.0))
        } else {
            half.tan() / half
        };
        // Only what lies across the axis is stretched.
        let along = phi.omega.try_normalize(0.0).map_or_else(Vector3::zeros, |axis| axis * axis.dot(&phi.t));
        Self { tau: along + stretch * (phi.t - along), w: stretch * phi.omega }
    }

    /// φ with exp(φ) equal to this motion: Ω = k w, t = k τ + g w (w · τ), where k = (θ/2)/tan(θ/2), g = (1 − k)/|w|².
    pub fn twist(&self) -> Twist {
        let [k, g, ..] = coefficients(&self.w);
        Twist { t: k * self.tau + self.w * (g * self.w.dot(&self.tau)), omega: k * self.w }
    }

    /// ∂φ/∂(τ, w) of [`CayleyMotion::twist`], 6×6.
    pub fn twist_jacobian(&self) -> Matrix6<f64> {
        let (tau, w) = (&self.tau, &self.w);
        let [k, g, k_by_square, g_by_square] = coefficients(w);
        let product = w.dot(tau);
        let turn = Matrix3::identity() * k + w * w.transpose() * (2.0 * k_by_square);
        let shift_by_tau = Matrix3::identity() * k + w * w.transpose() * g;
        let shift_by_w = tau * w.transpose() * (2.0 * k_by_square)
            + (Matrix3::identity() * g + w * w.transpose() * (2.0 * g_by_square)) * product
            + w * tau.transpose() * g;
        let mut jacobian = Matrix6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&shift_by_tau);
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&shift_by_w);
        jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        jacobian
    }
}

/// k, g, and their derivatives by |w|².
fn coefficients(w: &Vector3<f64>) -> [f64; 4] {
    let s = 0.25 * w.norm_squared();
    if s < SERIES_BELOW {
        let g = 0.25 * (1.0 / 3.0 - s * (1.0 / 5.0 - s * (1.0 / 7.0 - s * (1.0 / 9.0 - s / 11.0))));
        let k_by_square = -0.125 * (2.0 / 3.0 - s * (4.0 / 5.0 - s * (6.0 / 7.0 - s * 8.0 / 9.0)));
        let g_by_square = -0.25 * (1.0 / 20.0 - s * (1.0 / 14.0 - s * (1.0 / 12.0 - s / 11.0)));
        return [1.0 - 4.0 * s * g, g, k_by_square, g_by_square];
    }
    let half = s.sqrt();
    let k = half.atan() / half;
    let g = (1.0 - k) / (4.0 * s);
    let k_by_square = ((1.0 + s).recip() - k) / (8.0 * s);
    [k, g, k_by_square, -(k_by_square + g) / (4.0 * s)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twists() -> impl Iterator<Item = Twist> {
        let axis = Vector3::new(0.3, -0.5, 0.8).normalize();
        [0.0, 1e-9, 1e-3, 0.06, 0.064, 0.5, 2.0, 3.1]
            .into_iter()
            .map(move |theta| Twist { t: Vector3::new(0.4, -1.0, 2.0), omega: axis * theta })
    }

    #[test]
    fn displacements_are_linear_in_the_mean_point() {
        for phi in twists() {
            let (motion, cayley) = (phi.exp(), CayleyMotion::from_twist(&phi));
            let before = Vector3::new(1.0, -0.7, 4.0);
            let after = motion.apply(&before);
            let error = after - before - cayley.tau - cayley.w.cross(&(0.5 * (before + after)));
            assert!(error.norm() < 1e-13 * (1.0 + cayley.w.norm()), "{phi:?}: {error:?}");
        }
    }

    #[test]
    fn the_twist_comes_back() {
        for phi in twists() {
            let back = CayleyMotion::from_twist(&phi).twist();
            assert!((back.vector() - phi.vector()).norm() < 1e-12, "{phi:?} {back:?}");
        }
    }

    #[test]
    fn the_jacobian_is_the_numeric_one() {
        for phi in twists() {
            let at = CayleyMotion::from_twist(&phi).vector();
            let jacobian = CayleyMotion::from_vector(&at).twist_jacobian();
            let step = 1e-6 * at.norm();
            for i in 0..6 {
                let moved =
                    |s: f64| CayleyMotion::from_vector(&(at + s * Vector6::ith(i, step))).twist().vector();
                let numeric = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                assert!((numeric - jacobian.column(i)).norm() < 1e-8, "{phi:?} {i}: {numeric}");
            }
        }
    }
}
