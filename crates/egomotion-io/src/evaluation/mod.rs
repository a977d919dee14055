//! A trajectory against the truth, from whatever both are given as.

mod stated;
mod trajectories;

use std::path::Path;

use egomotion::geometry::RigidMotion;
use egomotion::metrics::{
    Delta, Drift, ErrorStatistics, KITTI_LENGTHS_M, RelativePoseError, TrajectoryAlignment,
    absolute_errors_m, align, kitti_drift, pairs, relative_pose_error, relative_pose_errors,
};

use serde_json::{Value, json};

use crate::IoError;
use crate::tables::trajectory::TrajectoryFormat;
pub use stated::StatedUncertainty;
use trajectories::Compared;

/// How trajectories are compared.
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluationOptions {
    /// TrajectoryFormat of both files; `None` is told by their rows.
    pub format: Option<TrajectoryFormat>,
    /// Whether poses belong to each other by their time stamps, where both have them, or row by row.
    pub by_time: bool,
    /// Time stamps farther apart than this do not belong to each other, in seconds.
    pub largest_gap_s: f64,
    /// What is laid over the truth before positions are compared.
    pub alignment: TrajectoryAlignment,
    /// Lengths of path over which drift is measured, in metres.
    pub lengths_m: Vec<f64>,
    /// Distances over which relative motions are compared, each with its name.
    pub deltas: Vec<(String, Delta)>,
    /// The truth's own standard deviation of each component of φ from frame to frame, in metres and radians.
    pub truth_sigma: [f64; 6],
}

impl Default for EvaluationOptions {
    /// Those of the command: by time, laid over the truth, relative motions over a second and a metre.
    fn default() -> Self {
        Self {
            format: None,
            by_time: true,
            largest_gap_s: 0.01,
            alignment: TrajectoryAlignment::Se3,
            lengths_m: KITTI_LENGTHS_M.to_vec(),
            deltas: vec![("1s".to_owned(), Delta::Seconds(1.0)), ("1m".to_owned(), Delta::Metres(1.0))],
            truth_sigma: [0.0; 6],
        }
    }
}

/// Errors of the relative motions over one distance.
#[derive(Debug, Clone, PartialEq)]
pub struct RelativeErrors {
    /// The distance, as it was named.
    pub name: String,
    /// Of translation, in metres.
    pub translation_m: ErrorStatistics,
    /// Of rotation, in degrees.
    pub rotation_deg: ErrorStatistics,
}

/// All that is said of a trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Poses compared.
    pub poses: usize,
    /// What they were associated by: `time` or `row`.
    pub associated_by: &'static str,
    /// Errors from frame to frame.
    pub step: RelativePoseError,
    /// Errors over longer distances.
    pub relative: Vec<RelativeErrors>,
    /// Drift; `None` where the path is shorter than all lengths.
    pub drift: Option<Drift>,
    /// What was laid over the truth; nothing where the positions determine no alignment.
    pub alignment: TrajectoryAlignment,
    /// The scale of that.
    pub scale: f64,
    /// Errors of position, in metres.
    pub absolute_m: Option<ErrorStatistics>,
    /// Whether the stated uncertainty is true, where the estimate is the folder of a run.
    pub stated: Option<StatedUncertainty>,
    /// What the user should know of the comparison.
    pub warnings: Vec<String>,
}

impl Evaluation {
    /// Read two trajectories, lay them over each other, compare.
    ///
    /// Each is a file of TUM, KITTI or EuRoC rows, the folder of a run, or a recording with true poses.
    ///
    /// # Errors
    /// A file cannot be read, or fewer than two poses belong to each other.
    pub fn of(estimate: &Path, truth: &Path, options: &EvaluationOptions) -> Result<Self, IoError> {
        let compared = Compared::read(estimate, truth, options)?;
        let mut warnings: Vec<String> = compared.warning.iter().cloned().collect();
        let (mut alignment, true_poses) = (options.alignment, &compared.truth);
        let laid = align(&compared.estimate, true_poses, alignment).or_else(|| {
            let words = "the positions lie on a line or a point, and determine no alignment: none is made";
            warnings.push(words.to_owned());
            alignment = TrajectoryAlignment::None;
            align(&compared.estimate, true_poses, alignment)
        });
        let laid =
            laid.ok_or_else(|| IoError::new(estimate, "has no pose to compare", "check both files"))?;
        let aligned: Vec<RigidMotion> = compared.estimate.iter().map(|pose| laid.apply(pose)).collect();
        let step = relative_pose_error(&aligned, true_poses).ok_or_else(|| {
            let reason = format!("{} pose in common with {}", true_poses.len(), truth.display());
            IoError::new(estimate, reason, "two are needed")
        })?;
        let over = |(name, delta): &(String, Delta)| {
            let errors =
                relative_pose_errors(&aligned, true_poses, &pairs(*delta, true_poses, &compared.times_s));
            let of = |value: fn(&egomotion::metrics::PoseError) -> f64| {
                ErrorStatistics::of(&errors.iter().map(value).collect::<Vec<_>>())
            };
            let (translation_m, rotation_deg) = (of(|e| e.translation_m)?, of(|e| e.rotation_deg)?);
            Some(RelativeErrors { name: name.clone(), translation_m, rotation_deg })
        };
        Ok(Self {
            poses: true_poses.len(),
            associated_by: compared.how,
            step,
            relative: options.deltas.iter().filter_map(over).collect(),
            drift: kitti_drift(&aligned, true_poses, &options.lengths_m),
            alignment,
            scale: laid.scale,
            absolute_m: ErrorStatistics::of(&absolute_errors_m(&aligned, true_poses)),
            stated: StatedUncertainty::read(estimate, truth, options)?,
            warnings,
        })
    }
    /// The same as JSON, with the keys of `egomotion evaluate --json`.
    pub fn json(&self) -> Value {
        let spread = |s: &ErrorStatistics| {
            json!({ "rmse": s.rmse, "mean": s.mean, "median": s.median, "std": s.std, "min": s.min,
                    "max": s.max, "sse": s.sse })
        };
        let over = |o: &RelativeErrors| {
            json!({ "delta": o.name, "pairs": o.translation_m.count,
                    "translation_m": spread(&o.translation_m), "rotation_deg": spread(&o.rotation_deg) })
        };
        json!({
            "frames": self.poses,
            "associated_by": self.associated_by,
            "t_rmse_m": self.step.t_rmse_m,
            "t_median_m": self.step.t_median_m,
            "t_max_m": self.step.t_max_m,
            "r_rmse_deg": self.step.r_rmse_deg,
            "r_median_deg": self.step.r_median_deg,
            "drift_percent": self.drift.map(|d| d.percent),
            "drift_deg_per_m": self.drift.map(|d| d.deg_per_m),
            "segments": self.drift.map_or(0, |d| d.segments),
            "relative": self.relative.iter().map(over).collect::<Vec<_>>(),
            "alignment": self.alignment.name(),
            "scale": self.scale,
            "absolute_m": self.absolute_m.as_ref().map(spread),
            "stated": self.stated.as_ref().map(StatedUncertainty::json),
        })
    }
}
