//! Drift over lengths of path, as KITTI's development kit measures it.

use super::relative::{pose_error, relative, travelled_m};
use crate::geometry::RigidMotion;

/// The lengths over which KITTI measures drift, in metres.
pub const KITTI_LENGTHS_M: [f64; 8] = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0];

/// KITTI starts a segment at every tenth frame.
const KITTI_START_EVERY: usize = 10;

/// KITTI drift: errors of the relative motion over segments of given lengths, per metre travelled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Mean translation error, in percent of the segment's length.
    pub percent: f64,
    /// Mean rotation error, in degrees per metre.
    pub deg_per_m: f64,
    /// Number of segments.
    pub segments: usize,
}

/// KITTI drift over segments of the given lengths from every tenth frame; `None` without a segment.
///
/// A segment of length L from frame i ends at the first frame whose distance along the *true* path
/// exceeds that of i by more than L, and its error is divided by L, as in the benchmark's own
/// program. Poses are `world_from_camera`; lengths that are not positive are ignored.
pub fn kitti_drift(estimate: &[RigidMotion], truth: &[RigidMotion], lengths_m: &[f64]) -> Option<Drift> {
    let n = estimate.len().min(truth.len());
    let (estimate, truth) = (&estimate[..n], &truth[..n]);
    let travelled = travelled_m(truth);
    let (mut percent, mut deg_per_m, mut segments) = (0.0, 0.0, 0);
    for i in (0..n).step_by(KITTI_START_EVERY) {
        for &length in lengths_m.iter().filter(|l| **l > 0.0) {
            let Some(j) = (i..n).find(|&k| travelled[k] > travelled[i] + length) else { continue };
            let error = pose_error(&relative(&estimate[i], &estimate[j]), &relative(&truth[i], &truth[j]));
            percent += 100.0 * error.translation_m / length;
            deg_per_m += error.rotation_deg / length;
            segments += 1;
        }
    }
    let count = segments as f64;
    (segments > 0).then(|| Drift { percent: percent / count, deg_per_m: deg_per_m / count, segments })
}
