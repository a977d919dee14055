//! The one form of every linear motion equation: n · V(P) = c.

use nalgebra::{Vector3, Vector6};

use crate::geometry::Twist;

/// A direction n, applied to the velocity of the point P, has a known rate: n · V(P) = c ± σ.
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
