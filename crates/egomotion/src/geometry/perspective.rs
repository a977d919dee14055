//! Perspective flow: how the image of a moving point moves, equations (2) and (3).

use nalgebra::{Vector2, Vector3};

use super::twist::Twist;

/// Image velocity (vx, vy), in pixels, of a point P moving with velocity V, equation (2).
///
/// `focal_px` is f; P must lie in front of the camera (Z > 0).
pub fn image_velocity(p: &Vector3<f64>, v: &Vector3<f64>, focal_px: f64) -> Vector2<f64> {
    Vector2::new(v.x - p.x * v.z / p.z, v.y - p.y * v.z / p.z) * (focal_px / p.z)
}

/// Image velocity (vx, vy), in pixels per interval, of the pixel (x, y) at depth Z under φ, equation (3).
///
/// φ is that of the camera that sees (x, y): use [`Twist::seen_from`] for the other ones.
pub fn image_flow(phi: &Twist, x: f64, y: f64, z_m: f64, focal_px: f64) -> Vector2<f64> {
    let (t, w, f) = (&phi.t, &phi.omega, focal_px);
    Vector2::new(
        (f * t.x - x * t.z) / z_m - x * y / f * w.x + (f + x * x / f) * w.y - y * w.z,
        (f * t.y - y * t.z) / z_m - (f + y * y / f) * w.x + x * y / f * w.y + x * w.z,
    )
}
