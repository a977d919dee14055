//! What a lens does to the image: the distortion models of the calibration tools.
//!
//! Radial and tangential polynomials (Brown 1966; "plumb bob"), the rational polynomial of OpenCV, and the equidistant
//! polynomial of fisheye lenses (Kannala and Brandt 2006). All act on normalised coordinates (X/Z, Y/Z).

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

/// Radii of normalised coordinates are looked at up to here, 89.4° off the axis.
pub(super) const LARGEST_RADIUS: f64 = 100.0;

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

impl Distortion {
    /// ∂(distorted)/∂(normalised), 2×2, at normalised coordinates.
    pub(crate) fn jacobian(&self, n: &Vector2<f64>) -> Matrix2<f64> {
        let (g, slope) = self.radial(n.norm_squared());
        let [p1, p2] = self.tangential();
        let mixed = 2.0 * (p1 * n.x + p2 * n.y);
        let tangential =
            Matrix2::new(2.0 * p1 * n.y + 6.0 * p2 * n.x, mixed, mixed, 6.0 * p1 * n.y + 2.0 * p2 * n.x);
        Matrix2::identity() * g + 2.0 * slope * n * n.transpose() + tangential
    }

    /// Distorted coordinates, wherever the polynomials lead.
    pub(super) fn apply(&self, n: &Vector2<f64>) -> Vector2<f64> {
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
    pub(super) fn radial(&self, square: f64) -> (f64, f64) {
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
                let (bent, slope) = fisheye_radius(k, radius.atan());
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

    pub(super) fn is_finite(&self) -> bool {
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        match self {
            Self::None => true,
            Self::RadialTangential { k, p } => finite(k) && finite(p),
            Self::Rational { k, p } => finite(k) && finite(p),
            Self::Equidistant { k } => finite(k),
        }
    }

    /// The radius (of a fisheye: the angle) up to which a larger one is also larger in the image.
    pub(super) fn reach(&self) -> f64 {
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
pub(super) fn fisheye_radius(k: &[f64; 4], angle: f64) -> (f64, f64) {
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::geometry) const LENSES: [Distortion; 4] = [
        Distortion::None,
        Distortion::RadialTangential { k: [-0.283_408, 0.073_959, 0.01], p: [1.9e-3, -1.8e-3] },
        Distortion::Rational { k: [0.9, -0.2, 0.03, 1.2, -0.1, 0.02], p: [1e-3, -2e-3] },
        Distortion::Equidistant { k: [0.0034, 0.0007, -0.0020, 0.0002] },
    ];

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
}
