//! One camera as it is made: a pinhole and what its lens does to the image.
//!
//! The models are those of the calibration tools: radial and tangential polynomials (Brown 1966;
//! "plumb bob"), the rational polynomial of OpenCV, and the equidistant polynomial of fisheye lenses
//! (Kannala and Brandt 2006). All act on normalised coordinates (X/Z, Y/Z).

use nalgebra::{Matrix2, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What a lens does to normalised coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub enum Distortion {
    /// Nothing: a pinhole.
    #[default]
    None,
    /// 1 + k1 r² + k2 r⁴ + k3 r⁶ along the radius, and the tangential p1, p2.
    RadialTangential {
        /// k1, k2, k3.
        k: [f64; 3],
        /// p1, p2.
        p: [f64; 2],
    },
    /// (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶) along the radius, and p1, p2.
    Rational {
        /// k1 … k6.
        k: [f64; 6],
        /// p1, p2.
        p: [f64; 2],
    },
    /// The angle θ to the axis becomes the radius θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).
    Equidistant {
        /// k1 … k4.
        k: [f64; 4],
    },
}

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

/// Radii of normalised coordinates are looked at up to here, 89.4° off the axis.
const LARGEST_RADIUS: f64 = 100.0;
/// An undistorted point is found when it distorts to the given one to within this.
const CONVERGED: f64 = 1e-13;

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
                let scale = if radius > 1e-9 * point.z { bent(k, angle).0 / radius } else { 1.0 / point.z };
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
                let angle = increasing_root(|a| bent(k, a), radius, self.reach)?;
                let across = if radius > 0.0 { distorted * (angle.sin() / radius) } else { Vector2::zeros() };
                Some(Vector3::new(across.x, across.y, angle.cos()))
            }
            _ => self.undistort(&distorted).map(|n| n.push(1.0).normalize()),
        }
    }

    /// Distorted normalised coordinates; `None` where the lens model turns back on itself.
    pub fn distort(&self, normalised: &Vector2<f64>) -> Option<Vector2<f64>> {
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
        for _ in 0..30 {
            let error = self.distortion.apply(&n) - distorted;
            if error.norm() <= CONVERGED * (1.0 + radius) {
                let inside = n.norm() <= end && self.distortion.jacobian(&n).determinant() > 0.0;
                return inside.then_some(n);
            }
            n -= self.distortion.jacobian(&n).try_inverse()? * error;
        }
        None
    }
}

impl Distortion {
    /// ∂(distorted)/∂(normalised), 2×2, at normalised coordinates.
    pub fn jacobian(&self, n: &Vector2<f64>) -> Matrix2<f64> {
        let (g, slope) = self.radial(n.norm_squared());
        let [p1, p2] = self.tangential();
        let mixed = 2.0 * (p1 * n.x + p2 * n.y);
        let tangential =
            Matrix2::new(2.0 * p1 * n.y + 6.0 * p2 * n.x, mixed, mixed, 6.0 * p1 * n.y + 2.0 * p2 * n.x);
        Matrix2::identity() * g + 2.0 * slope * n * n.transpose() + tangential
    }

    /// Distorted coordinates, wherever the polynomials lead.
    fn apply(&self, n: &Vector2<f64>) -> Vector2<f64> {
        let square = n.norm_squared();
        let (g, _) = self.radial(square);
        let [p1, p2] = self.tangential();
        let product = 2.0 * n.x * n.y;
        Vector2::new(
            n.x * g + p1 * product + p2 * (square + 2.0 * n.x * n.x),
            n.y * g + p1 * (square + 2.0 * n.y * n.y) + p2 * product,
        )
    }

    /// Factor of the radius, and its derivative by r², at r².
    fn radial(&self, square: f64) -> (f64, f64) {
        match self {
            Self::None => (1.0, 0.0),
            Self::RadialTangential { k, .. } => polynomial(&[1.0, k[0], k[1], k[2]], square),
            Self::Rational { k, .. } => {
                let (n, dn) = polynomial(&[1.0, k[0], k[1], k[2]], square);
                let (m, dm) = polynomial(&[1.0, k[3], k[4], k[5]], square);
                (n / m, (dn * m - n * dm) / (m * m))
            }
            Self::Equidistant { k } => {
                if square < 1e-8 {
                    return (1.0 + (k[0] - 1.0 / 3.0) * square, k[0] - 1.0 / 3.0);
                }
                let radius = square.sqrt();
                let (bent, slope) = bent(k, radius.atan());
                let per_radius = slope / (1.0 + square);
                (bent / radius, (per_radius * radius - bent) / (2.0 * square * radius))
            }
        }
    }

    fn tangential(&self) -> [f64; 2] {
        match self {
            Self::RadialTangential { p, .. } | Self::Rational { p, .. } => *p,
            Self::None | Self::Equidistant { .. } => [0.0; 2],
        }
    }

    fn is_finite(&self) -> bool {
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        match self {
            Self::None => true,
            Self::RadialTangential { k, p } => finite(k) && finite(p),
            Self::Rational { k, p } => finite(k) && finite(p),
            Self::Equidistant { k } => finite(k),
        }
    }

    /// The radius (of a fisheye: the angle) up to which a larger one is also larger in the image.
    fn reach(&self) -> f64 {
        let end = LARGEST_RADIUS * LARGEST_RADIUS;
        let first = |polynomial: &[f64], end: f64| roots(polynomial, end).first().map(|s| s.sqrt());
        match self {
            Self::None => f64::INFINITY,
            // d(r g)/dr as a polynomial in r².
            Self::RadialTangential { k, .. } => {
                first(&[1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2]], end).unwrap_or(f64::INFINITY)
            }
            Self::Rational { k, .. } => {
                let (n, m) = ([1.0, k[0], k[1], k[2]], [1.0, k[3], k[4], k[5]]);
                // (n/m + 2 s (n′m − n m′)/m²) m², by powers of s = r².
                let mut slope = [0.0; 7];
                for (i, a) in n.iter().enumerate() {
                    for (j, b) in m.iter().enumerate() {
                        slope[i + j] += a * b * (1.0 + 2.0 * (i as f64 - j as f64));
                    }
                }
                let turns = first(&slope, end).unwrap_or(f64::INFINITY);
                turns.min(first(&m, end).unwrap_or(f64::INFINITY))
            }
            Self::Equidistant { k } => {
                let half_turn = std::f64::consts::PI;
                let slope = [1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2], 9.0 * k[3]];
                first(&slope, half_turn * half_turn).unwrap_or(half_turn)
            }
        }
    }
}

/// The radius that a fisheye gives to an angle, and its derivative.
fn bent(k: &[f64; 4], angle: f64) -> (f64, f64) {
    let square = angle * angle;
    let (q, slope) = polynomial(&[1.0, k[0], k[1], k[2], k[3]], square);
    (angle * q, q + 2.0 * square * slope)
}

/// Value and derivative of a polynomial with coefficients by rising power.
fn polynomial(coefficients: &[f64], at: f64) -> (f64, f64) {
    coefficients.iter().rev().fold((0.0, 0.0), |(value, slope), c| (value * at + c, slope * at + value))
}

/// Roots in (0, `end`], rising: between two of the derivative's lies at most one.
fn roots(coefficients: &[f64], end: f64) -> Vec<f64> {
    let derivative: Vec<f64> =
        coefficients.iter().enumerate().skip(1).map(|(power, c)| power as f64 * c).collect();
    if derivative.is_empty() {
        return Vec::new();
    }
    let value = |s| polynomial(coefficients, s).0;
    let mut found = Vec::new();
    let mut start = 0.0;
    for stop in roots(&derivative, end).into_iter().chain([end]) {
        let rising = value(stop) > value(start);
        if (value(start) > 0.0) != (value(stop) > 0.0) {
            let (mut low, mut high) = (start, stop);
            for _ in 0..100 {
                let middle = 0.5 * (low + high);
                if (value(middle) > 0.0) == rising { high = middle } else { low = middle }
            }
            found.push(0.5 * (low + high));
        }
        start = stop;
    }
    found
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

    const LENSES: [Distortion; 4] = [
        Distortion::None,
        Distortion::RadialTangential { k: [-0.283_408, 0.073_959, 0.01], p: [1.9e-3, -1.8e-3] },
        Distortion::Rational { k: [0.9, -0.2, 0.03, 1.2, -0.1, 0.02], p: [1e-3, -2e-3] },
        Distortion::Equidistant { k: [0.0034, 0.0007, -0.0020, 0.0002] },
    ];

    fn camera(distortion: Distortion) -> Camera {
        Camera::new((458.654, 457.296), (367.215, 248.375), distortion, (752, 480)).unwrap()
    }

    #[test]
    fn the_jacobian_is_the_derivative() {
        for lens in LENSES {
            for n in [Vector2::new(0.3, -0.4), Vector2::new(-0.7, 0.2), Vector2::new(1e-6, 2e-6)] {
                let h = 1e-6;
                let column =
                    |e: Vector2<f64>| (lens.apply(&(n + h * e)) - lens.apply(&(n - h * e))) / (2.0 * h);
                let numeric = Matrix2::from_columns(&[column(Vector2::x()), column(Vector2::y())]);
                assert!((lens.jacobian(&n) - numeric).norm() < 1e-8, "{lens:?} {n}");
            }
        }
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
