//! Time to impact: the inverse of looming, and the window through which what is an obstacle passes.

use documented::DocumentedFields;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::geometry::Gaussian;

/// 97.5 % quantile of the normal distribution: half the width of a 95 % interval, in σ.
pub const Z95: f64 = 1.959_963_984_540_054;

/// Time to impact, counted from the later frame, held as looming because that stays near-Gaussian through VZ = 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimeToImpact {
    /// Looming in 1/s; positive approaches.
    pub looming: Gaussian<1>,
}

impl TimeToImpact {
    /// 1/looming in seconds; `None` where the point does not approach.
    #[inline(always)]
    pub fn seconds(&self) -> Option<f64> {
        let looming = self.looming.value();
        (looming > 0.0).then(|| looming.recip())
    }

    /// The 95 % interval in seconds; its far end is infinite where looming may be zero. `None` where the
    /// whole interval recedes.
    #[inline(always)]
    pub fn interval95_s(&self) -> Option<(f64, f64)> {
        let (fast, slow) = self.rates95();
        (fast > 0.0).then(|| (fast.recip(), if slow > 0.0 { slow.recip() } else { f64::INFINITY }))
    }

    /// The ends of looming's 95 % interval, the faster one first, in 1/s.
    #[inline(always)]
    pub(crate) fn rates95(&self) -> (f64, f64) {
        let (mean, half) = (self.looming.value(), Z95 * self.looming.sigma(0));
        (mean + half, mean - half)
    }
}

/// The window, in metres around the left camera's axis, that the vehicle sweeps: what crosses it is an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct Vehicle {
    /// Left edge (X, negative is left).
    pub left_m: f64,
    /// Right edge.
    pub right_m: f64,
    /// Upper edge (Y, negative is up).
    pub top_m: f64,
    /// Lower edge; keep it above the ground, which always comes nearest.
    pub bottom_m: f64,
}

impl Default for Vehicle {
    fn default() -> Self {
        Self { left_m: -0.5, right_m: 0.5, top_m: -0.5, bottom_m: 0.5 }
    }
}

impl Vehicle {
    /// Whether a point at P′ moving by V per second passes through the window when it reaches the camera's plane.
    #[inline(always)]
    pub fn is_crossed_by(&self, later: &Vector3<f64>, velocity: &Vector3<f64>, seconds: f64) -> bool {
        let (x, y) = (later.x + velocity.x * seconds, later.y + velocity.y * seconds);
        // Without branches, so that many points can be asked at once.
        (x >= self.left_m) & (x <= self.right_m) & (y >= self.top_m) & (y <= self.bottom_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn impact(looming: f64, sigma: f64) -> TimeToImpact {
        TimeToImpact { looming: Gaussian::scalar(looming, sigma * sigma) }
    }

    #[test]
    fn the_interval_is_open_where_looming_may_vanish() {
        let sure = impact(0.5, 0.01);
        assert_eq!(sure.seconds(), Some(2.0));
        let (lo, hi) = sure.interval95_s().unwrap();
        assert!(lo < 2.0 && 2.0 < hi && hi < 2.1);
        assert_eq!(impact(0.01, 0.02).interval95_s().unwrap().1, f64::INFINITY);
        assert_eq!(impact(-0.01, 0.02).seconds(), None);
        assert_eq!(impact(-0.1, 0.02).interval95_s(), None);
    }

    #[test]
    fn only_what_crosses_the_window_counts() {
        let window = Vehicle::default();
        let (ahead, velocity) = (Vector3::new(0.1, 0.0, 4.0), Vector3::new(0.0, 0.0, -2.0));
        assert!(window.is_crossed_by(&ahead, &velocity, 2.0));
        assert!(!window.is_crossed_by(&ahead, &Vector3::new(0.4, 0.0, -2.0), 2.0));
    }
}
