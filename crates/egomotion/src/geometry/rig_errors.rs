//! By how much a real stereo rig differs from the one that is stated, and what this does to what it measures.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

use super::rig::StereoRig;

/// Number of a rig's errors.
pub const RIG_ERRORS: usize = 8;

/// The errors of a stereo rig: the real one less the stated one.
///
/// The right camera is turned by (pitch, yaw, roll) = (α, β, γ) about its own X, Y and Z: a point q of its frame becomes
/// q + ω × q. So every disparity falls by f (−x y α + (1 + x²) β − y γ + x ρ), with the place (x, y) in the right image in
/// units of f; a yaw is nearly an offset of disparity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct RigErrors {
    /// Turn of the right camera about its Y axis, in radians.
    pub yaw_rad: f64,
    /// Turn of the right camera about its X axis, in radians.
    pub pitch_rad: f64,
    /// Turn of the right camera about its Z axis, in radians.
    pub roll_rad: f64,
    /// By how much the right focal length exceeds the left one, as a share of it.
    pub focal_ratio: f64,
    /// Relative error of the focal length of both cameras.
    pub focal: f64,
    /// Error of the principal point of both cameras along x, in pixels.
    pub centre_x_px: f64,
    /// Error of the principal point of both cameras along y, in pixels.
    pub centre_y_px: f64,
    /// Relative error of the baseline.
    pub baseline: f64,
}

impl RigErrors {
    /// What each number of [`RigErrors::vector`] is called, with the unit in which people write it.
    pub const NAMES: [&str; RIG_ERRORS] = [
        "yaw_deg",
        "pitch_deg",
        "roll_deg",
        "focal_ratio",
        "focal",
        "centre_x_px",
        "centre_y_px",
        "baseline",
    ];

    /// What one of each name's units is in the units of [`RigErrors::vector`].
    pub const UNITS: [f64; RIG_ERRORS] = {
        let degree = std::f64::consts::PI / 180.0;
        [degree, degree, degree, 1.0, 1.0, 1.0, 1.0, 1.0]
    };

    /// (yaw, pitch, roll, ratio, focal length, principal point x and y, baseline), in radians, shares and pixels.
    pub fn vector(&self) -> SVector<f64, RIG_ERRORS> {
        let Self { yaw_rad, pitch_rad, roll_rad, focal_ratio, focal, centre_x_px, centre_y_px, baseline } =
            *self;
        [yaw_rad, pitch_rad, roll_rad, focal_ratio, focal, centre_x_px, centre_y_px, baseline].into()
    }

    /// The errors of [`RigErrors::vector`].
    pub fn from_vector(errors: &SVector<f64, RIG_ERRORS>) -> Self {
        let [yaw_rad, pitch_rad, roll_rad, focal_ratio, focal, centre_x_px, centre_y_px, baseline] =
            (*errors).into();
        Self { yaw_rad, pitch_rad, roll_rad, focal_ratio, focal, centre_x_px, centre_y_px, baseline }
    }

    /// Whether the rig is as it is stated.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// How a point leaves the stated right camera's frame for the real one's: exp(ω).
    pub fn right_from_stated(&self) -> Matrix3<f64> {
        *Rotation3::new(Vector3::new(self.pitch_rad, self.yaw_rad, self.roll_rad)).matrix()
    }

    /// ∂(x, y, d)/∂errors of what a rig measures as (x, y, d), 3×8: pixels per radian, per share and per pixel.
    ///
    /// The place (x, y) is that of the left image.
    #[inline(always)]
    pub fn jacobian(xyd: &Vector3<f64>, rig: &StereoRig) -> SMatrix<f64, 3, RIG_ERRORS> {
        let f = rig.focal_px;
        let (x, y) = ((xyd.x - xyd.z) / f, xyd.y / f);
        let of_disparity = [-f * (1.0 + x * x), f * x * y, f * y, -f * x, xyd.z, 0.0, 0.0, xyd.z];
        let mut jacobian = SMatrix::<f64, 3, RIG_ERRORS>::zeros();
        jacobian.set_row(2, &of_disparity.into());
        (jacobian[(0, 4)], jacobian[(1, 4)]) = (xyd.x, xyd.y);
        (jacobian[(0, 5)], jacobian[(1, 6)]) = (1.0, rig.aspect());
        jacobian
    }

    /// By how much the disparity of (x, y, d) exceeds that of the stated rig, in pixels, to first order.
    pub fn disparity_excess_px(&self, xyd: &Vector3<f64>, rig: &StereoRig) -> f64 {
        (Self::jacobian(xyd, rig).row(2) * self.vector())[0]
    }

    /// What the stated rig would have measured in place of (x, y, d): the errors taken away, to first order.
    #[inline(always)]
    pub fn corrected(&self, xyd: &Vector3<f64>, rig: &StereoRig) -> Vector3<f64> {
        xyd - Self::jacobian(xyd, rig) * self.vector()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a rig with these errors measures of a point of its left camera's frame.
    fn measured(p: &Vector3<f64>, errors: &RigErrors, rig: &StereoRig) -> Vector3<f64> {
        let focal = rig.focal_px * (1.0 + errors.focal);
        let centre = Vector3::new(errors.centre_x_px, errors.centre_y_px * rig.aspect(), 0.0);
        let left = Vector3::new(p.x, p.y, 0.0) * (focal / p.z) + centre;
        let baseline = Vector3::x() * (rig.baseline_m * (1.0 + errors.baseline));
        let q = errors.right_from_stated() * (p - baseline);
        let right = focal * (1.0 + errors.focal_ratio) * q.x / q.z + centre.x;
        Vector3::new(left.x, left.y, left.x - right)
    }

    #[test]
    fn the_derivative_is_that_of_a_rig_with_errors() {
        let rig = StereoRig::new(400.0, (150.0, 130.0), 0.2, (320, 240)).unwrap();
        let rig = StereoRig { focal_y_px: 410.0, ..rig };
        for point in [Vector3::new(0.4, -0.7, 3.0), Vector3::new(-1.5, 0.6, 5.0)] {
            let exact = rig.project(&point).unwrap();
            assert!((measured(&point, &RigErrors::default(), &rig) - exact).norm() < 1e-12);
            let jacobian = RigErrors::jacobian(&exact, &rig);
            for k in 0..RIG_ERRORS {
                let moved = |h: f64| measured(&point, &RigErrors::from_vector(&SVector::ith(k, h)), &rig);
                let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!((numeric - jacobian.column(k)).amax() < 1e-4, "{k} {numeric}");
            }
        }
    }

    #[test]
    fn corrections_undo_small_errors() {
        let rig = StereoRig::new(400.0, (150.0, 130.0), 0.2, (320, 240)).unwrap();
        let errors = RigErrors::from_vector(&[3e-4, -2e-4, 4e-4, 5e-4, 1e-3, 0.2, -0.3, 1e-3].into());
        let point = Vector3::new(0.4, -0.7, 3.0);
        let seen = measured(&point, &errors, &rig);
        let exact = rig.project(&point).unwrap();
        assert!((seen - exact).norm() > 0.1);
        assert!((errors.corrected(&seen, &rig) - exact).norm() < 1e-3);
        assert_eq!(RigErrors::from_vector(&errors.vector()), errors);
    }
}
