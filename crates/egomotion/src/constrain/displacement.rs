//! A finite displacement as rows that are linear and exact: the mean point and Cayley's vector.
//!
//! With Q = ½ (P + P′), P′ − P = τ + w × Q without approximation ([`CayleyMotion`]). So n · (P′ − P) = c is the row
//! \[nᵀ, (Q × n)ᵀ\] (τ, w) = c, where (3) and (13) take finite displacements for velocities.

use nalgebra::Vector3;

use super::linear::LinearConstraint;
use crate::geometry::{CayleyMotion, StereoRig};
use crate::observe::StereoTrack;

/// What a track says of a finite motion; the unknowns of each row are (τ, w).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisplacementConstraints {
    /// x′ − x and y′ − y in pixels: n = (f, 0, −x′)/Z and (0, f, −y′)/Z.
    pub image: [LinearConstraint; 2],
    /// Z′ − Z in metres: n = (0, 0, 1).
    pub depth: LinearConstraint,
}

/// The rows of a track; `None` where a disparity is not positive.
///
/// σ is that of each residual under the motion `at`: places and disparities before and after enter through n, Q and c.
pub fn constraints(
    track: &StereoTrack,
    rig: &StereoRig,
    at: &CayleyMotion,
) -> Option<DisplacementConstraints> {
    let (a, b) = (&track.before.mean, &track.after.mean);
    let (before, after) = (rig.point(a)?, rig.point(b)?);
    let mean_point = 0.5 * (before + after);
    let jacobians = [rig.point_jacobian(a), rig.point_jacobian(b)];
    let predicted = at.tau + at.w.cross(&mean_point);
    // `direct` is the derivative of c − n · predicted by (x, y, d) before and after with Q held.
    let constraint = |normal: Vector3<f64>, rate: f64, direct: [Vector3<f64>; 2]| {
        let by_mean_point = 0.5 * normal.cross(&at.w);
        let [by_before, by_after] = [0, 1].map(|i| direct[i] - jacobians[i].tr_mul(&by_mean_point));
        let variance =
            by_before.dot(&(track.before.cov * by_before)) + by_after.dot(&(track.after.cov * by_after));
        LinearConstraint { point: mean_point, normal, rate, sigma: variance.max(0.0).sqrt() }
    };
    let (f, z, d) = (rig.focal_px, before.z, Vector3::z());
    let along = |axis: Vector3<f64>, place_after: f64, rate: f64| {
        let normal = (axis * f - Vector3::z() * place_after) / z;
        let by_before = -axis - d * (normal.dot(&predicted) / a.z);
        constraint(normal, rate, [by_before, axis * (1.0 + predicted.z / z)])
    };
    Some(DisplacementConstraints {
        image: [along(Vector3::x(), b.x, b.x - a.x), along(Vector3::y(), b.y, b.y - a.y)],
        depth: constraint(Vector3::z(), after.z - before.z, [d * (before.z / a.z), -d * (after.z / b.z)]),
    })
}
