//! Scaled depth, the time to impact of one that leaves rotation out, and how wrong that is.

use nalgebra::{Matrix3, Vector3};

use super::impact::TimeToImpact;
use crate::geometry::{Gaussian, Twist};

/// Scaled depth −Z/tZ of a point (X, Y, Z), in metres: "time to impact" by the translation alone, counted from the frame
/// in which the point is (Colombo and Del Bimbo 1999, reference \[5\] of the paper's section 1).
///
/// `phi` is φ per interval of `dt_s` seconds, and `z_variance` that of Z along the point's ray, in m². Both are carried to
/// the inverse, −tZ/(Z Δt), which stays near-Gaussian where tZ vanishes. `None` unless Z > 0.
///
/// A turn about Y brings what is on one side nearer, and scaled depth does not know it:
///
/// ```
/// use egomotion::geometry::Gaussian;
/// use egomotion::motion::{rotation_left_out, scaled_depth};
/// use nalgebra::Vector3;
///
/// // 0.1 m ahead and 0.01 rad about Y in 0.1 s; a point 10 m away, 5 m to the right.
/// let phi = Gaussian::independent([0.0, 0.0, -0.1, 0.0, 0.01, 0.0], [1e-8; 6]);
/// let point = Vector3::new(5.0, 0.0, 10.0);
/// let scaled = scaled_depth(&point, 0.01, &phi, 0.1).and_then(|time| time.seconds()).ok_or("not ahead")?;
/// // VZ = −0.1 − 0.01 · 5 m: it is met in 6.7 s, not in 10.
/// let too_late = rotation_left_out(&point, 0.01, &phi, 0.1).ok_or("it recedes")?.value();
/// assert_eq!((format!("{scaled:.1}"), format!("{too_late:.1}")), ("10.0".into(), "3.3".into()));
/// # Ok::<(), &str>(())
/// ```
pub fn scaled_depth(
    point: &Vector3<f64>,
    z_variance: f64,
    phi: &Gaussian<6>,
    dt_s: f64,
) -> Option<TimeToImpact> {
    let (z, tz) = (point.z, phi.mean[2]);
    let by_z = tz / (z * z);
    let variance = by_z * by_z * z_variance + phi.cov[(2, 2)] / (z * z);
    let looming = Gaussian::scalar(-tz / (z * dt_s), variance / (dt_s * dt_s));
    (z > 0.0).then_some(TimeToImpact { looming })
}

/// Scaled depth less the time to impact −Z/VZ, VZ = tZ + ΩX Y − ΩY X (1), in seconds with its variance: what leaving
/// rotation out makes of the time, for the arguments of [`scaled_depth`].
///
/// It is −Z/tZ + Z/VZ, and in terms of looming (ΩX Y − ΩY X)/(Z Δt), which grows with the distance from the centre of the
/// image and does not depend on depth. `None` unless Z > 0 and both the translation and the point approach.
pub fn rotation_left_out(
    point: &Vector3<f64>,
    z_variance: f64,
    phi: &Gaussian<6>,
    dt_s: f64,
) -> Option<Gaussian<1>> {
    let (z, tz) = (point.z, phi.mean[2]);
    let vz = Twist::from_vector(&phi.mean).velocity(point).z;
    let per_vz2 = (vz * vz).recip();
    // The point moves along its ray: (X, Y) in proportion to Z, so ∂VZ/∂Z = (VZ − tZ)/Z.
    let by_z = vz.recip() - tz.recip() - (vz - tz) * per_vz2;
    let by_motion = Vector3::new(z / (tz * tz) - z * per_vz2, -z * point.y * per_vz2, z * point.x * per_vz2);
    let motion_cov: Matrix3<f64> = phi.cov.fixed_view::<3, 3>(2, 2).into();
    let variance = by_z * by_z * z_variance + by_motion.dot(&(motion_cov * by_motion));
    let error = Gaussian::scalar(dt_s * (z / vz - z / tz), dt_s * dt_s * variance);
    (z > 0.0 && tz < 0.0 && vz < 0.0).then_some(error)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(tz: f64, wy: f64) -> Gaussian<6> {
        Gaussian::independent([0.0, 0.0, tz, 0.0, wy, 0.0], [1e-8; 6])
    }

    #[test]
    fn nothing_is_said_of_what_is_not_met() {
        let beside = Vector3::new(5.0, 0.0, 10.0);
        assert!(scaled_depth(&-beside, 0.0, &motion(-0.1, 0.0), 1.0).is_none());
        let recedes = scaled_depth(&beside, 0.0, &motion(0.1, 0.0), 1.0).unwrap();
        assert_eq!(recedes.seconds(), None);
        assert!(rotation_left_out(&beside, 0.0, &motion(0.1, 0.1), 1.0).is_none());
        // It turns away faster than the camera goes ahead: VZ = −0.1 + 0.03 · 5 m.
        assert!(rotation_left_out(&beside, 0.0, &motion(-0.1, -0.03), 1.0).is_none());
    }

    #[test]
    fn the_error_in_looming_grows_with_the_angle_and_not_with_depth() {
        for z in [2.0, 20.0] {
            let phi = motion(-0.1, 0.01);
            let [centre, side] = [0.0, 0.5 * z].map(|x| Vector3::new(x, 0.0, z));
            assert!(rotation_left_out(&centre, 0.01, &phi, 0.1).unwrap().value().abs() < 1e-12);
            let scaled = scaled_depth(&side, 0.01, &phi, 0.1).unwrap().seconds().unwrap();
            let impact = scaled - rotation_left_out(&side, 0.01, &phi, 0.1).unwrap().value();
            // −(ΩX y − ΩY x)/(f Δt) = 0.01 · 0.5/0.1 s.
            assert!((impact.recip() - scaled.recip() - 0.05).abs() < 1e-12);
        }
    }
}
