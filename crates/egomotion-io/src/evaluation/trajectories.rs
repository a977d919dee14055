//! Two trajectories of the same frames, from whatever they are given as.

use std::path::Path;

use egomotion::geometry::RigidMotion;
use egomotion::metrics::associate;

use super::EvaluationOptions;
use crate::IoError;
use crate::source::{FrameFiles, Source};
use crate::tables::trajectory::{self, Pose, TrajectoryFormat};

/// Poses that belong to each other.
pub(super) struct Compared {
    pub estimate: Vec<RigidMotion>,
    pub truth: Vec<RigidMotion>,
    /// Time stamps of the truth, where it has them.
    pub times_s: Vec<f64>,
    /// What they were associated by.
    pub how: &'static str,
    /// That not all poses are compared.
    pub warning: Option<String>,
}

impl Compared {
    pub(super) fn read(
        estimate_path: &Path,
        truth_path: &Path,
        options: &EvaluationOptions,
    ) -> Result<Self, IoError> {
        let (estimate, truth) = (poses(estimate_path, options.format)?, poses(truth_path, options.format)?);
        let (at, true_at) = (times(&estimate), times(&truth));
        let (pairs, by_time) = match (&at, &true_at, options.by_time) {
            (Some(a), Some(b), true) => (associate(a, b, options.largest_gap_s), true),
            _ => ((0..estimate.len().min(truth.len())).map(|i| (i, i)).collect(), false),
        };
        if by_time && pairs.len() < 2 {
            let (count, gap) = (pairs.len(), options.largest_gap_s);
            let reason = format!("{count} pose lies within {gap} s of one of {}", truth_path.display());
            let advice = "check the clocks, raise --max-diff, or compare row by row with --associate row";
            return Err(IoError::new(estimate_path, reason, advice));
        }
        let warning = (pairs.len() < estimate.len().max(truth.len())).then(|| {
            format!(
                "{} has {} poses, {} has {}; {} are compared",
                estimate_path.display(),
                estimate.len(),
                truth_path.display(),
                truth.len(),
                pairs.len()
            )
        });
        let pose = |pose: &Pose| pose.world_from_camera;
        Ok(Self {
            estimate: pairs.iter().map(|&(i, _)| pose(&estimate[i])).collect(),
            truth: pairs.iter().map(|&(_, j)| pose(&truth[j])).collect(),
            times_s: true_at.or(at).map_or_else(Vec::new, |t| {
                pairs.iter().filter_map(|&(i, j)| t.get(if by_time { j } else { i }).copied()).collect()
            }),
            how: if by_time { "time" } else { "row" },
            warning,
        })
    }
}

/// Time stamps, where every pose has one.
fn times(poses: &[Pose]) -> Option<Vec<f64>> {
    poses.iter().map(|pose| pose.time_s).collect()
}

/// A trajectory file, the folder of a run, or a recording with true poses.
pub(super) fn poses(path: &Path, format: Option<TrajectoryFormat>) -> Result<Vec<Pose>, IoError> {
    if !path.is_dir() {
        return trajectory::read(path, format);
    }
    let ours = path.join("trajectory_tum.txt");
    if ours.is_file() {
        return trajectory::read(&ours, Some(TrajectoryFormat::Tum));
    }
    let source = Source::open(path)?;
    let frames = source.sequences.first().map(|sequence| &sequence.frames[..]).unwrap_or_default();
    let pose =
        |frame: &FrameFiles| Some(Pose { time_s: Some(frame.time_s), world_from_camera: frame.truth? });
    let poses: Vec<Pose> = frames.iter().filter_map(pose).collect();
    if poses.is_empty() {
        return Err(IoError::new(path, "the recording has no true poses", "give a file with the truth"));
    }
    Ok(poses)
}
