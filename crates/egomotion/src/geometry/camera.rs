//! One camera as it is made: a pinhole with its lens.

use nalgebra::{Vector2, Vector3};
use serde::Serialize;
use thiserror::Error;

use super::distortion::{Distortion, LARGEST_RADIUS, fisheye_radius};

/// An undistorted point is found when it distorts to the given one to within this share of 1 plus the radius.
const UNDISTORTED_TOLERANCE: f64 = 1e-13;
/// Most of Newton's steps to undistort a point; one that needs more is given up.
const UNDISTORTION_STEPS: usize = 30;

/// A pinhole camera with a lens; pixel centres lie at integers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Camera {
    focal_px: Vector2<f64>,
    centre_px: Vector2<f64>,
    distortion: Distortion,
    size: (usize, usize),
    /// Where the model turns back on itself: a radius of normalised coordinates, or an angle of a fisheye.
    reach: f64,
}

/// Why a camera cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum CameraError {
    /// A focal length is zero, negative or not a number.
    #[error("focal length {0} px is not positive")]
    Focal(f64),
    /// The principal point is not a finite number.
    #[error("the principal point is not finite")]
    PrincipalPoint,
    /// A distortion coefficient is not a finite number.
    #[error("a distortion coefficient is not finite")]
    Distortion,
    /// The image has no pixels.
    #[error("image size {0}x{1} is empty")]
    Size(usize, usize),
}

impl Camera {
    /// A camera with focal lengths (fx, fy) and principal point (cx, cy), in pixels, of an image of `size`
    /// (width, height).
    ///
    /// # Errors
    /// [`CameraError`] names the first quantity that cannot be used.
    pub fn new(
        focal_px: (f64, f64),
        centre_px: (f64, f64),
        distortion: Distortion,
        size: (usize, usize),
    ) -> Result<Self, CameraError> {
        let unusable = [focal_px.0, focal_px.1].into_iter().find(|f| !(f.is_finite() && *f > 0.0));
        if let Some(focal) = unusable {
            return Err(CameraError::Focal(focal));
        }
        if !(centre_px.0.is_finite() && centre_px.1.is_finite()) {
            return Err(CameraError::PrincipalPoint);
        }
        if size.0 == 0 || size.1 == 0 {
            return Err(CameraError::Size(size.0, size.1));
        }
        if !distortion.is_finite() {
            return Err(CameraError::Distortion);
        }
        Ok(Self {
            focal_px: Vector2::new(focal_px.0, focal_px.1),
            centre_px: Vector2::new(centre_px.0, centre_px.1),
            distortion,
            size,
            reach: distortion.reach(),
        })
    }

    /// Focal lengths (fx, fy), in pixels.
    pub fn focal_px(&self) -> (f64, f64) {
        (self.focal_px.x, self.focal_px.y)
    }

    /// Principal point (cx, cy), in pixels.
    pub fn centre_px(&self) -> (f64, f64) {
        (self.centre_px.x, self.centre_px.y)
    }

    /// What the lens does.
    pub fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// (width, height) of the image, in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Pixel (u, v) of a point (X, Y, Z) of the camera's frame; `None` where the lens model does not hold.
    ///
    /// The pixel may lie outside the image. Only a fisheye sees points with Z ≤ 0.
    pub fn project(&self, point: &Vector3<f64>) -> Option<Vector2<f64>> {
        let distorted = match &self.distortion {
            Distortion::Equidistant { k } => {
                let radius = point.xy().norm();
                let angle = radius.atan2(point.z);
                let scale =
                    if radius > 1e-9 * point.z { fisheye_radius(k, angle).0 / radius } else { 1.0 / point.z };
                (angle <= self.reach).then(|| point.xy() * scale)
            }
            _ if point.z > 0.0 => self.distort(&(point.xy() / point.z)),
            _ => None,
        }?;
        Some(distorted.component_mul(&self.focal_px) + self.centre_px)
    }

    /// Direction, of length 1, of the points that are seen at pixel (u, v); `None` where the lens model
    /// does not reach.
    pub fn direction(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        let distorted = (pixel - self.centre_px).component_div(&self.focal_px);
        match &self.distortion {
            Distortion::Equidistant { k } => {
                let radius = distorted.norm();
                let angle = increasing_root(|a| fisheye_radius(k, a), radius, self.reach)?;
                let across = if radius > 0.0 { distorted * (angle.sin() / radius) } else { Vector2::zeros() };
                Some(Vector3::new(across.x, across.y, angle.cos()))
            }
            _ => self.undistort(&distorted).map(|n| n.push(1.0).normalize()),
        }
    }

    /// Distorted normalised coordinates; `None` where the lens model turns back on itself.
    pub(crate) fn distort(&self, normalised: &Vector2<f64>) -> Option<Vector2<f64>> {
        let radius = normalised.norm();
        let seen = match self.distortion {
            Distortion::Equidistant { .. } => radius.atan(),
            _ => radius,
        };
        (seen <= self.reach).then(|| self.distortion.apply(normalised))
    }

    /// The normalised coordinates that distort to the given ones, by Newton's method; `None` if there are
    /// none where the lens model holds.
    pub fn undistort(&self, distorted: &Vector2<f64>) -> Option<Vector2<f64>> {
        if self.distortion == Distortion::None {
            return distorted.iter().all(|c| c.is_finite()).then_some(*distorted);
        }
        let end = match self.distortion {
            Distortion::Equidistant { .. } => self.reach.min(LARGEST_RADIUS.atan()).tan(),
            _ => self.reach.min(LARGEST_RADIUS),
        };
        // The radius alone can always be found; the tangential part is a small step from there.
        let radius = distorted.norm();
        let along = |r: f64| {
            let (g, slope) = self.distortion.radial(r * r);
            (r * g, g + 2.0 * r * r * slope)
        };
        let start = increasing_root(along, radius, end).unwrap_or(end);
        let mut n = if radius > 0.0 { distorted * (start / radius) } else { *distorted };
        for _ in 0..UNDISTORTION_STEPS {
            let error = self.distortion.apply(&n) - distorted;
            if error.norm() <= UNDISTORTED_TOLERANCE * (1.0 + radius) {
                let inside = n.norm() <= end && self.distortion.jacobian(&n).determinant() > 0.0;
                return inside.then_some(n);
            }
            n -= self.distortion.jacobian(&n).try_inverse()? * error;
        }
        None
    }
}

/// Where an increasing function from 0, given with its derivative, reaches `target` in \[0, `end`\]: Newton's
/// method, kept between bounds that halve.
fn increasing_root(f: impl Fn(f64) -> (f64, f64), target: f64, end: f64) -> Option<f64> {
    let (mut low, mut high) = (0.0, end);
    if !(target >= 0.0 && target <= f(end).0) {
        return None;
    }
    let mut x = target.min(end);
    for _ in 0..200 {
        let (value, slope) = f(x);
        if value > target {
            high = x
        } else {
            low = x
        }
        let next = x - (value - target) / slope;
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        if (next - x).abs() <= 1e-15 * end.min(1.0 + x) {
            return Some(next);
        }
        x = next;
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::distortion::tests::LENSES;

    fn camera(distortion: Distortion) -> Camera {
        Camera::new((458.654, 457.296), (367.215, 248.375), distortion, (752, 480)).unwrap()
    }

    #[test]
    fn undistorting_inverts_distorting_over_the_whole_image() {
        for lens in LENSES {
            let camera = camera(lens);
            for (i, j) in (0..=10).flat_map(|i| (0..=10).map(move |j| (i, j))) {
                let pixel = Vector2::new(75.1 * f64::from(i), 47.9 * f64::from(j));
                let direction = camera.direction(&pixel).unwrap_or_else(|| panic!("{lens:?} {pixel}"));
                let back = camera.project(&(direction * 7.5)).unwrap();
                assert!((back - pixel).norm() < 1e-9, "{lens:?} {pixel} {back}");
                let n = direction.xy() / direction.z;
                assert!((camera.undistort(&camera.distort(&n).unwrap()).unwrap() - n).norm() < 1e-11);
            }
        }
    }

    #[test]
    fn where_a_lens_turns_back_nothing_is_seen() {
        // r (1 − 0.5 r²) is largest at r = √(2/3), where it is .544.
        let camera = camera(Distortion::RadialTangential { k: [-0.5, 0.0, 0.0], p: [0.0; 2] });
        let seen = |x: f64| camera.distort(&Vector2::new(x, 0.0)).map(|d| d.x);
        assert!((seen(0.8).unwrap() - 0.8 * (1.0 - 0.32)).abs() < 1e-15);
        assert_eq!((seen(0.82), seen(1.2), seen(f64::NAN)), (None, None, None));
        assert!(camera.undistort(&Vector2::new(0.54, 0.0)).is_some());
        assert_eq!(camera.undistort(&Vector2::new(0.55, 0.0)), None);
        assert_eq!(camera.undistort(&Vector2::new(f64::NAN, 0.0)), None);
        assert_eq!(camera.project(&Vector3::new(0.0, 0.0, -1.0)), None);
        // It rises again beyond r = 1, but that is another image.
        let again = Distortion::RadialTangential { k: [-0.9, 0.3, 0.0], p: [0.0; 2] };
        assert!((again.reach() - ((2.7 - (2.7_f64 * 2.7 - 6.0).sqrt()) / 3.0).sqrt()).abs() < 1e-12);
        // A pole of the rational model.
        let pole = Distortion::Rational { k: [0.0, 0.0, 0.0, -0.25, 0.0, 0.0], p: [0.0; 2] };
        assert!((pole.reach() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_fisheye_sees_beyond_a_right_angle() {
        let camera = Camera::new((190.0, 190.0), (255.5, 255.5), LENSES[3], (512, 512)).unwrap();
        let sideways = Vector3::new(1.0, 0.2, -0.1);
        let pixel = camera.project(&sideways).unwrap();
        assert!((camera.direction(&pixel).unwrap() - sideways.normalize()).norm() < 1e-12);
        assert!((camera.project(&Vector3::new(0.0, 0.0, 2.0)).unwrap().x - 255.5).abs() < 1e-12);
        let flat = (pixel - Vector2::new(255.5, 255.5)) / 190.0;
        assert_eq!(camera.undistort(&flat), None);
    }

    #[test]
    fn unusable_cameras_are_refused() {
        let camera = |f, c, d, size| Camera::new((f, 400.0), (c, 10.0), d, size);
        let none = Distortion::None;
        assert_eq!(camera(0.0, 1.0, none, (4, 4)), Err(CameraError::Focal(0.0)));
        assert_eq!(camera(1.0, f64::INFINITY, none, (4, 4)), Err(CameraError::PrincipalPoint));
        assert_eq!(camera(1.0, 1.0, none, (4, 0)), Err(CameraError::Size(4, 0)));
        let lens = Distortion::Equidistant { k: [f64::NAN, 0.0, 0.0, 0.0] };
        assert_eq!(camera(1.0, 1.0, lens, (4, 4)), Err(CameraError::Distortion));
    }
}
