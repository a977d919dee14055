//! How good an answer is: trajectory errors, the paper's relative errors, and whether the stated
//! uncertainty is true.

use std::iter::zip;

use nalgebra::{Matrix3, SVector};

use crate::geometry::{Gaussian, RigidMotion};

/// The lengths over which KITTI measures drift, in metres.
pub const KITTI_LENGTHS_M: [f64; 8] = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0];

/// KITTI starts a segment at every tenth frame.
pub const KITTI_START_EVERY: usize = 10;

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

/// Relative pose error of each step k → k + 1: step_true⁻¹ step_estimated.
///
/// Poses are `world_from_camera`; where one list is longer its tail is ignored.
pub fn relative_pose_errors(estimate: &[RigidMotion], truth: &[RigidMotion]) -> Vec<PoseError> {
    let steps = zip(estimate.windows(2), truth.windows(2));
    steps.map(|(e, g)| pose_error(&relative(&g[0], &g[1]), &relative(&e[0], &e[1]))).collect()
}

/// Relative pose error over all steps; `None` if the lists do not share two poses.
///
/// Poses are `world_from_camera`; where one list is longer its tail is ignored.
pub fn relative_pose_error(estimate: &[RigidMotion], truth: &[RigidMotion]) -> Option<RelativePoseError> {
    let errors = relative_pose_errors(estimate, truth);
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
fn relative(a: &RigidMotion, b: &RigidMotion) -> RigidMotion {
    let back = a.rotation.try_inverse().unwrap_or_else(|| a.rotation.transpose());
    RigidMotion { rotation: back * b.rotation, translation: back * (b.translation - a.translation) }
}

/// What is left of `b` after `a` is undone, a⁻¹ b.
fn pose_error(a: &RigidMotion, b: &RigidMotion) -> PoseError {
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

/// The figures of the paper's section 7 over pairs of estimate and truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionSeven {
    /// ERM, signed: mean of (estimate − truth)/truth, in percent (Tables 3, 6); `None` where the truth is zero.
    pub erm_signed_percent: Option<f64>,
    /// ERM, absolute: mean of |(estimate − truth)/truth|, in percent; `None` where the truth is zero.
    pub erm_abs_percent: Option<f64>,
    /// STD: standard deviation of estimate/truth (n − 1), in percent; `None` with fewer than two points.
    pub std_percent: Option<f64>,
    /// EAM: mean of |estimate − truth|, in the unit of the values, over all points.
    pub eam: f64,
    /// Standard deviation of estimate − truth (n − 1), in the unit of the values; 0 for one point.
    pub std: f64,
    /// Number of points with an estimate and a truth.
    pub count: usize,
    /// Number of them that count for the relative figures.
    pub relative_count: usize,
}

impl SectionSeven {
    /// The figures of (estimate, truth) pairs; `None` without a pair of numbers.
    ///
    /// The relative figures count only points whose |truth| is at least 10 % of its 99th
    /// percentile, since a relative error means nothing where the truth passes through zero.
    pub fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let truths: Vec<f64> =
            pairs.iter().filter(|(e, t)| e.is_finite() && t.is_finite()).map(|(_, t)| t.abs()).collect();
        Self::beyond(pairs, 0.1 * quantile(&truths, 0.99)?)
    }

    /// The same with a floor of its own: relative figures count only points whose |truth| reaches it.
    pub fn beyond(pairs: &[(f64, f64)], floor: f64) -> Option<Self> {
        let known: Vec<_> = pairs.iter().copied().filter(|(e, t)| e.is_finite() && t.is_finite()).collect();
        let countable = known.iter().filter(|(_, t)| *t != 0.0 && t.abs() >= floor);
        let relative: Vec<f64> = countable.map(|(e, t)| 100.0 * (e - t) / t).collect();
        let errors: Vec<f64> = known.iter().map(|(e, t)| e - t).collect();
        Some(Self {
            erm_signed_percent: mean(&relative),
            erm_abs_percent: mean_abs(&relative),
            std_percent: standard_deviation(&relative),
            eam: mean_abs(&errors)?,
            std: standard_deviation(&errors).unwrap_or(0.0),
            count: errors.len(),
            relative_count: relative.len(),
        })
    }
}

/// Normalised estimation error squared over many estimates: whether covariances tell the truth.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Nees {
    sum: f64,
    degrees: usize,
    /// Estimates that were counted.
    pub count: usize,
    /// Estimates whose covariance was singular or not finite.
    pub refused: usize,
}

impl Nees {
    /// Count one estimate against the truth.
    pub fn add<const N: usize>(&mut self, estimate: &Gaussian<N>, truth: &SVector<f64, N>) {
        match estimate.mahalanobis2(truth).filter(|d| d.is_finite()) {
            Some(distance) => {
                self.sum += distance;
                self.degrees += N;
                self.count += 1;
            }
            None => self.refused += 1,
        }
    }

    /// Mean NEES for each degree of freedom: 1 if the covariances are right; `None` before the first estimate.
    pub fn per_degree(&self) -> Option<f64> {
        (self.degrees > 0).then(|| self.sum / self.degrees as f64)
    }

    /// Standard error of [`Nees::per_degree`] if the covariances are right: √(2/degrees).
    pub fn standard_error(&self) -> Option<f64> {
        (self.degrees > 0).then(|| (2.0 / self.degrees as f64).sqrt())
    }
}

/// How many intervals hold the truth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Intervals that hold the truth.
    pub inside: usize,
    /// Intervals whose upper end lies below the truth.
    pub below: usize,
    /// Intervals whose lower end lies above the truth.
    pub above: usize,
}

impl Coverage {
    /// Count the interval `lo` … `hi` (ends included, may be infinite); one with a NaN does not count.
    pub fn add(&mut self, lo: f64, hi: f64, truth: f64) {
        if truth < lo {
            self.above += 1;
        } else if truth > hi {
            self.below += 1;
        } else if lo <= truth && truth <= hi {
            self.inside += 1;
        }
    }

    /// Number of intervals counted.
    pub fn total(&self) -> usize {
        self.inside + self.below + self.above
    }

    /// Share of intervals that hold the truth, 0 … 1; `None` before the first.
    pub fn share(&self) -> Option<f64> {
        (self.total() > 0).then(|| self.inside as f64 / self.total() as f64)
    }
}

/// The `q` quantile (0 … 1), interpolated linearly between the sorted values; `None` if there are none.
///
/// At ½ it is the median, with the mean of the two middle values of an even count.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = q.clamp(0.0, 1.0) * last as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[(at.ceil() as usize).min(last)]);
    Some(if low == high { low } else { low + (high - low) * at.fract() })
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn mean_abs(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().map(|v| v.abs()).sum::<f64>() / values.len() as f64)
}

fn root_mean_square(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt())
}

fn standard_deviation(values: &[f64]) -> Option<f64> {
    let centre = mean(values)?;
    let squares: f64 = values.iter().map(|v| (v - centre).powi(2)).sum();
    (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt())
}
