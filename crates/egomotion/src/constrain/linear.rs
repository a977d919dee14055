//! The one form of every linear motion equation: n · V(P) = c.

use nalgebra::{Vector3, Vector6};

use crate::geometry::Twist;

/// A direction n, applied to the velocity of the point P, has a known rate: n · V(P) = c ± σ.
///
/// A point 1 m to the right and 2 m ahead comes nearer by 0.1 m: that is one row \[nᵀ, (P × n)ᵀ\] φ = c. A motion
/// straight ahead explains it; so does a turn about Y.
///
/// ```
/// use egomotion::constrain::LinearConstraint;
/// use egomotion::geometry::Twist;
/// use nalgebra::{Vector3, Vector6};
///
/// let point = Vector3::new(1.0, 0.0, 2.0);
/// let nearer = LinearConstraint { point, normal: Vector3::z(), rate: -0.1, sigma: 0.01 };
/// assert_eq!(nearer.row(), Vector6::new(0.0, 0.0, 1.0, 0.0, -1.0, 0.0));
/// let straight = Twist { t: Vector3::new(0.0, 0.0, -0.1), omega: Vector3::zeros() };
/// let turn = Twist { t: Vector3::zeros(), omega: Vector3::new(0.0, 0.1, 0.0) };
/// assert_eq!((nearer.residual(&straight), nearer.residual(&turn)), (0.0, 0.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearConstraint {
    /// The point P, in metres, left camera.
    pub point: Vector3<f64>,
    /// The direction n; its unit is that of the rate over metres.
    pub normal: Vector3<f64>,
    /// The rate c per interval: metres (DCCE, DV), 1/m (DV as printed) or pixels (image flow).
    pub rate: f64,
    /// Standard deviation of n · V(P) − c, in the unit of the rate.
    pub sigma: f64,
}

impl LinearConstraint {
    /// The row \[nᵀ, (P × n)ᵀ\] that multiplies φ.
    pub fn row(&self) -> Vector6<f64> {
        let moment = self.point.cross(&self.normal);
        Vector6::new(self.normal.x, self.normal.y, self.normal.z, moment.x, moment.y, moment.z)
    }

    /// c − n · V(P) under φ.
    pub fn residual(&self, phi: &Twist) -> f64 {
        self.rate - self.normal.dot(&phi.velocity(&self.point))
    }

    /// The same constraint in other units: everything but the point times `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            point: self.point,
            normal: self.normal * factor,
            rate: self.rate * factor,
            sigma: self.sigma * factor.abs(),
        }
    }
}
