//! Errors of relative motions: from frame to frame, or over a time or a length of path.

use std::str::FromStr;

use nalgebra::Matrix3;

use super::{quantile, root_mean_square};
use crate::geometry::RigidMotion;

/// Error of one relative motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseError {
    /// Length of the translation that is left over, in metres.
    pub translation_m: f64,
    /// Angle of the rotation that is left over, in degrees.
    pub rotation_deg: f64,
}

/// Frame-to-frame relative pose errors, summarised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativePoseError {
    /// Root mean square of the translation error, in metres.
    pub t_rmse_m: f64,
    /// Median translation error, in metres.
    pub t_median_m: f64,
    /// Largest translation error, in metres.
    pub t_max_m: f64,
    /// Root mean square of the rotation error, in degrees.
    pub r_rmse_deg: f64,
    /// Median rotation error, in degrees.
    pub r_median_deg: f64,
    /// Largest rotation error, in degrees.
    pub r_max_deg: f64,
    /// Number of steps from one frame to the next.
    pub steps: usize,
}

/// How far the two poses of a relative motion are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delta {
    /// So many frames.
    Frames(usize),
    /// At least so much time, in seconds.
    Seconds(f64),
    /// At least such a length of the true path, in metres.
    Metres(f64),
}

impl FromStr for Delta {
    type Err = &'static str;

    /// A number of frames, seconds or metres: `1f`, `0.5s`, `10m`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const KINDS: &str = "give a distance such as 1f, 1s or 10m";
        let unit = text.chars().last().ok_or(KINDS)?;
        let number = &text[..text.len() - unit.len_utf8()];
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let value =
            || number.parse().ok().filter(|&value| positive(value)).ok_or("must be a positive number");
        match unit {
            'f' => match number.parse() {
                Ok(frames) if frames > 0 => Ok(Self::Frames(frames)),
                _ => Err("must be a whole number of at least 1"),
            },
            's' => value().map(Self::Seconds),
            'm' => value().map(Self::Metres),
            _ => Err(KINDS),
        }
    }
}

/// Pairs of frames that follow each other at a distance `delta`: each begins where the last one ends.
///
/// `times_s` are needed for [`Delta::Seconds`] alone. Without a positive distance there are none.
pub fn pairs(delta: Delta, truth: &[RigidMotion], times_s: &[f64]) -> Vec<(usize, usize)> {
    let along: Vec<f64> = match delta {
        Delta::Frames(_) => (0..truth.len()).map(|k| k as f64).collect(),
        Delta::Seconds(_) => times_s.iter().copied().take(truth.len()).collect(),
        Delta::Metres(_) => travelled_m(truth),
    };
    let step = match delta {
        Delta::Frames(frames) => frames as f64,
        Delta::Seconds(step) | Delta::Metres(step) => step,
    };
    let Some(mut begun) = along.first().copied().filter(|_| step > 0.0) else { return Vec::new() };
    let mut ends = vec![0];
    for (k, &here) in along.iter().enumerate() {
        // Time stamps that are a rounding short of a second are a second.
        if here - begun >= step * (1.0 - 1e-9) {
            ends.push(k);
            begun = here;
        }
    }
    ends.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Errors of the relative motions between the frames of each pair: motion_true⁻¹ motion_estimated.
///
/// Poses are `world_from_camera`; pairs beyond the end of a list are left out.
pub fn relative_pose_errors(
    estimate: &[RigidMotion],
    truth: &[RigidMotion],
    pairs: &[(usize, usize)],
) -> Vec<PoseError> {
    let motion = |poses: &[RigidMotion], (i, j): (usize, usize)| Some(relative(poses.get(i)?, poses.get(j)?));
    let error = |&pair: &(usize, usize)| Some(pose_error(&motion(truth, pair)?, &motion(estimate, pair)?));
    pairs.iter().filter_map(error).collect()
}

/// Relative pose error over all steps; `None` if the lists do not share two poses.
///
/// Poses are `world_from_camera`; where one list is longer its tail is ignored.
pub fn relative_pose_error(estimate: &[RigidMotion], truth: &[RigidMotion]) -> Option<RelativePoseError> {
    let count = estimate.len().min(truth.len());
    let steps: Vec<(usize, usize)> = (1..count).map(|k| (k - 1, k)).collect();
    let errors = relative_pose_errors(estimate, truth, &steps);
    let t: Vec<f64> = errors.iter().map(|e| e.translation_m).collect();
    let r: Vec<f64> = errors.iter().map(|e| e.rotation_deg).collect();
    Some(RelativePoseError {
        t_rmse_m: root_mean_square(&t)?,
        t_median_m: quantile(&t, 0.5)?,
        t_max_m: quantile(&t, 1.0)?,
        r_rmse_deg: root_mean_square(&r)?,
        r_median_deg: quantile(&r, 0.5)?,
        r_max_deg: quantile(&r, 1.0)?,
        steps: errors.len(),
    })
}

/// Distance travelled up to each pose, in metres; the first is 0.
pub fn travelled_m(poses: &[RigidMotion]) -> Vec<f64> {
    let steps = poses.windows(2).map(|p| (p[1].translation - p[0].translation).norm());
    let mut sum = 0.0;
    let along = steps.map(|step| {
        sum += step;
        sum
    });
    std::iter::once(0.0).chain(along).take(poses.len()).collect()
}

/// a⁻¹ b, with the true inverse: poses read from files are rotations to a few digits only.
pub(super) fn relative(a: &RigidMotion, b: &RigidMotion) -> RigidMotion {
    let back = a.rotation.try_inverse().unwrap_or_else(|| a.rotation.transpose());
    RigidMotion { rotation: back * b.rotation, translation: back * (b.translation - a.translation) }
}

/// What is left of `b` after `a` is undone, a⁻¹ b.
pub(super) fn pose_error(a: &RigidMotion, b: &RigidMotion) -> PoseError {
    let left = relative(a, b);
    PoseError {
        translation_m: left.translation.norm(),
        rotation_deg: trace_angle(&left.rotation).to_degrees(),
    }
}

/// Rotation angle by the trace, in radians: the benchmark's definition, with its rounding near zero.
fn trace_angle(rotation: &Matrix3<f64>) -> f64 {
    (0.5 * (rotation.trace() - 1.0)).clamp(-1.0, 1.0).acos()
}
