//! The rectified stereo rig: the one place that knows the sign of disparity and Z = b f / d.

use nalgebra::{ArrayStorage, Matrix3, SMatrix, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A rectified stereo rig: two parallel pinhole cameras, the right one at +baseline along X.
///
/// Three kinds of coordinates meet here:
/// - *pixel* coordinates (u right, v down, pixel centres at integers);
/// - *image* coordinates of the left camera, x = u − cx and y = (v − cy) fx/fy, in pixels of fx;
/// - *disparity* d = u_left − u_right + doffs, in pixels, so that Z = b f / d holds also for pairs
///   with different principal points. A disparity map on disk or from a matcher holds
///   u_left − u_right; [`StereoRig::disparity_from_shift`] turns it into d.
///
/// A depth camera is a rig too: choose any baseline and its depth becomes a disparity.
///
/// A point 4 m ahead and 0.5 m to the right, seen with f = 400 px and b = 0.2 m:
///
/// ```
/// use egomotion::geometry::StereoRig;
/// use nalgebra::Vector3;
///
/// let rig = StereoRig::new(400.0, (319.5, 239.5), 0.2, (640, 480))?;
/// // x = f X/Z and d = b f/Z.
/// let xyd = Vector3::new(50.0, 0.0, 20.0);
/// assert_eq!(rig.project(&Vector3::new(0.5, 0.0, 4.0)), Some(xyd));
/// assert_eq!(rig.depth(20.0), Some(4.0));
/// // A pixel of disparity is Z²/(b f) = 0.2 m of depth there.
/// assert!((rig.point_jacobian(&xyd)[(2, 2)] + 0.2).abs() < 1e-12);
/// # Ok::<(), egomotion::geometry::RigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StereoRig {
    /// Horizontal focal length fx, in pixels; the f of every formula.
    pub focal_px: f64,
    /// Vertical focal length fy, in pixels.
    pub focal_y_px: f64,
    /// Principal point of the left camera, horizontal, in pixels.
    pub cx_px: f64,
    /// Principal point of both cameras, vertical, in pixels.
    pub cy_px: f64,
    /// Difference of the horizontal principal points, cx_right − cx_left, in pixels.
    pub doffs_px: f64,
    /// Distance between the optical centres, in metres.
    pub baseline_m: f64,
    /// Image width, in pixels.
    pub width_px: usize,
    /// Image height, in pixels.
    pub height_px: usize,
}

/// A camera of a rig in whose frame φ can be given; all three are parallel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RigCamera {
    /// The left camera, in whose frame φ is estimated.
    #[default]
    Left,
    /// The right camera.
    Right,
    /// The cyclopean camera, in the middle between the two.
    Cyclopean,
}

/// Why a rig cannot measure anything.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum RigError {
    /// The focal length is zero, negative or not a number.
    #[error("focal length {0} px is not positive")]
    Focal(f64),
    /// The baseline is zero, negative or not a number.
    #[error("baseline {0} m is not positive; left and right may be swapped")]
    Baseline(f64),
    /// A principal point or offset is not a finite number.
    #[error("principal point is not finite")]
    PrincipalPoint,
    /// The image has no pixels.
    #[error("image size {0}x{1} is empty")]
    Size(usize, usize),
}

impl StereoRig {
    /// A rig with square pixels and equal principal points.
    ///
    /// # Errors
    /// [`RigError`] when the focal length, the baseline or the size is not positive.
    pub fn new(
        focal_px: f64,
        (cx_px, cy_px): (f64, f64),
        baseline_m: f64,
        (width_px, height_px): (usize, usize),
    ) -> Result<Self, RigError> {
        let rig = Self {
            focal_px,
            focal_y_px: focal_px,
            cx_px,
            cy_px,
            doffs_px: 0.0,
            baseline_m,
            width_px,
            height_px,
        };
        rig.check().map(|()| rig)
    }

    /// Whether the rig can measure depth at all.
    ///
    /// # Errors
    /// [`RigError`] names the first quantity that is not usable.
    pub fn check(&self) -> Result<(), RigError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if !positive(self.focal_px) {
            return Err(RigError::Focal(self.focal_px));
        }
        if !positive(self.focal_y_px) {
            return Err(RigError::Focal(self.focal_y_px));
        }
        if !positive(self.baseline_m) {
            return Err(RigError::Baseline(self.baseline_m));
        }
        if !(self.cx_px.is_finite() && self.cy_px.is_finite() && self.doffs_px.is_finite()) {
            return Err(RigError::PrincipalPoint);
        }
        if self.width_px == 0 || self.height_px == 0 {
            return Err(RigError::Size(self.width_px, self.height_px));
        }
        Ok(())
    }

    /// b f, in metre pixels: depth times disparity.
    pub fn depth_disparity_product(&self) -> f64 {
        self.baseline_m * self.focal_px
    }

    /// Z = b f / d, in metres; `None` unless d > 0.
    pub fn depth(&self, d: f64) -> Option<f64> {
        (d > 0.0).then(|| self.depth_disparity_product() / d)
    }

    /// d = b f / Z, in pixels; `None` unless Z > 0.
    pub fn disparity(&self, z_m: f64) -> Option<f64> {
        (z_m > 0.0).then(|| self.depth_disparity_product() / z_m)
    }

    /// Disparity d from the shift u_left − u_right between the two images, in pixels.
    pub fn disparity_from_shift(&self, shift_px: f64) -> f64 {
        shift_px + self.doffs_px
    }

    /// The shift u_left − u_right between the two images that belongs to disparity d, in pixels.
    pub fn shift_from_disparity(&self, d: f64) -> f64 {
        d - self.doffs_px
    }

    /// Vertical image coordinates per vertical pixel: fx / fy.
    pub fn aspect(&self) -> f64 {
        self.focal_px / self.focal_y_px
    }

    /// Image coordinates (x, y) of the pixel (u, v) of the left camera.
    pub fn image_from_pixel(&self, u: f64, v: f64) -> (f64, f64) {
        (u - self.cx_px, (v - self.cy_px) * self.aspect())
    }

    /// Pixel (u, v) of the left camera at image coordinates (x, y).
    pub fn pixel_from_image(&self, x: f64, y: f64) -> (f64, f64) {
        (x + self.cx_px, y / self.aspect() + self.cy_px)
    }

    /// The point (X, Y, Z) in metres, left camera, measured as (x, y, d); `None` unless d > 0.
    #[inline(always)]
    pub fn point(&self, xyd: &Vector3<f64>) -> Option<Vector3<f64>> {
        (xyd.z > 0.0).then(|| Vector3::new(xyd.x, xyd.y, self.focal_px) * (self.baseline_m / xyd.z))
    }

    /// Image coordinates and disparity (x, y, d) of a point of the left camera's frame; `None` unless Z > 0.
    #[inline(always)]
    pub fn project(&self, p: &Vector3<f64>) -> Option<Vector3<f64>> {
        (p.z > 0.0).then(|| Vector3::new(p.x, p.y, self.baseline_m) * (self.focal_px / p.z))
    }

    /// ∂(X, Y, Z)/∂(x, y, d) at a measured (x, y, d), 3×3.
    pub fn point_jacobian(&self, xyd: &Vector3<f64>) -> Matrix3<f64> {
        let k = self.baseline_m / xyd.z;
        let kd = -k / xyd.z;
        Matrix3::new(
            k,
            0.0,
            kd * xyd.x, //
            0.0,
            k,
            kd * xyd.y, //
            0.0,
            0.0,
            kd * self.focal_px,
        )
    }

    /// Change of (x, y, d) when a point P of the left camera's frame moves by a little: ∂(x, y, d)/∂P · `change`.
    #[inline(always)]
    pub(crate) fn projected_change(&self, p: &Vector3<f64>, change: &Vector3<f64>) -> Vector3<f64> {
        let k = self.focal_px / p.z;
        let kz = -k / p.z * change.z;
        Vector3::new(k * change.x + kz * p.x, k * change.y + kz * p.y, kz * self.baseline_m)
    }

    /// ∂(x, y, d)/∂(X, Y, Z) at a point of the left camera's frame, 3×3.
    pub fn project_jacobian(&self, p: &Vector3<f64>) -> Matrix3<f64> {
        let column = |i| self.projected_change(p, &Vector3::ith(i, 1.0));
        Matrix3::from_columns(&[column(0), column(1), column(2)])
    }

    /// ∂(v_x, v_y, Δv)/∂(t, Ω), 3×6: how (x, y, d) of a point changes with the velocities, (3) and (9).
    #[inline(always)]
    pub fn velocity_jacobian(&self, xyd: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
        let (f, [x, y, d]) = (self.focal_px, (*xyd).into());
        let per_m = d / self.depth_disparity_product();
        let (k, xf, yf) = (f * per_m, x / f, y / f);
        SMatrix::from_data(ArrayStorage([
            [k, 0.0, 0.0],
            [0.0, k, 0.0],
            [-x * per_m, -y * per_m, -d * per_m],
            [-x * yf, -f - y * yf, -d * yf],
            [f + x * xf, x * yf, d * xf],
            [-y, x, 0.0],
        ]))
    }

    /// Centre of a camera in the frame of the left one, in metres: what [`crate::geometry::Twist::seen_from`] takes, (4).
    pub fn centre_from_left(&self, camera: RigCamera) -> Vector3<f64> {
        let share = match camera {
            RigCamera::Left => 0.0,
            RigCamera::Right => 1.0,
            RigCamera::Cyclopean => 0.5,
        };
        Vector3::new(share * self.baseline_m, 0.0, 0.0)
    }

    /// Centre of the left camera in the cyclopean frame, (−b/2, 0, 0), in metres; the right one is its negative.
    pub fn left_from_cyclopean(&self) -> Vector3<f64> {
        Vector3::new(-0.5 * self.baseline_m, 0.0, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig() -> StereoRig {
        StereoRig::new(416.0, (159.5, 119.5), 0.13, (320, 240)).unwrap()
    }

    #[test]
    fn project_inverts_point() {
        let xyd = Vector3::new(12.0, -30.5, 17.25);
        let back = rig().project(&rig().point(&xyd).unwrap()).unwrap();
        assert!((back - xyd).norm() < 1e-12);
        let product = rig().project_jacobian(&rig().point(&xyd).unwrap()) * rig().point_jacobian(&xyd);
        assert!((product - Matrix3::identity()).norm() < 1e-12);
    }

    #[test]
    fn velocities_move_the_projection() {
        let p = Vector3::new(0.4, -0.3, 3.0);
        let (t, w) = (Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.02, 0.05, -0.03));
        let moved = rig().project_jacobian(&p) * (t + w.cross(&p));
        let phi = nalgebra::Vector6::new(t.x, t.y, t.z, w.x, w.y, w.z);
        let rates = rig().velocity_jacobian(&rig().project(&p).unwrap()) * phi;
        assert!((rates - moved).norm() < 1e-12);
    }

    #[test]
    fn cameras_stand_in_a_row() {
        let [left, middle, right] =
            [RigCamera::Left, RigCamera::Cyclopean, RigCamera::Right].map(|c| rig().centre_from_left(c));
        assert_eq!((left, middle), (Vector3::zeros(), -rig().left_from_cyclopean()));
        // A point straight ahead of the right camera is one disparity to the right of the left one's centre.
        assert_eq!(rig().project(&(right + Vector3::z())).unwrap().x, rig().disparity(1.0).unwrap());
    }

    #[test]
    fn unusable_rigs_are_refused() {
        assert_eq!(StereoRig::new(0.0, (0.0, 0.0), 0.1, (4, 4)), Err(RigError::Focal(0.0)));
        assert_eq!(StereoRig::new(1.0, (0.0, 0.0), -0.1, (4, 4)), Err(RigError::Baseline(-0.1)));
        assert!(StereoRig::new(f64::NAN, (0.0, 0.0), 0.1, (4, 4)).is_err());
        assert!(rig().point(&Vector3::new(1.0, 1.0, 0.0)).is_none());
    }
}
