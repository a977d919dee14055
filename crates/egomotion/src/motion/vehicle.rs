//! What the vehicle sweeps: the window through which what is an obstacle passes.

use documented::DocumentedFields;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

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

    #[test]
    fn only_what_crosses_the_window_counts() {
        let window = Vehicle::default();
        let (ahead, velocity) = (Vector3::new(0.1, 0.0, 4.0), Vector3::new(0.0, 0.0, -2.0));
        assert!(window.is_crossed_by(&ahead, &velocity, 2.0));
        assert!(!window.is_crossed_by(&ahead, &Vector3::new(0.4, 0.0, -2.0), 2.0));
    }
}
