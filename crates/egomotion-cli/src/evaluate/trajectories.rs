//! Two trajectories of the same frames, from whatever they are given as.

use std::path::Path;

use anyhow::{Result, bail};
use egomotion::geometry::RigidMotion;
use egomotion::metrics::associate;
use egomotion_io::source::Source;
use egomotion_io::trajectory::{self, Format, Pose};

use crate::args::{AssociateArg, EvaluateArgs, FormatArg};
use crate::terminal::tell;

/// Poses that belong to each other.
pub struct Compared {
    pub estimate: Vec<RigidMotion>,
    pub truth: Vec<RigidMotion>,
    /// Time stamps of the truth, where it has them.
    pub times_s: Vec<f64>,
    /// What they were associated by.
    pub how: &'static str,
}

impl Compared {
    pub fn read(args: &EvaluateArgs) -> Result<Self> {
        let format = args.format.map(|format| match format {
            FormatArg::Tum => Format::Tum,
            FormatArg::Kitti => Format::Kitti,
            FormatArg::Euroc => Format::Euroc,
        });
        let (estimate, truth) = (poses(&args.estimate, format)?, poses(&args.truth, format)?);
        let (at, true_at) = (times(&estimate), times(&truth));
        let pairs = match (&at, &true_at, args.associate) {
            (Some(a), Some(b), AssociateArg::Time) => associate(a, b, args.max_diff),
            _ => (0..estimate.len().min(truth.len())).map(|i| (i, i)).collect(),
        };
        let by_time = at.is_some() && true_at.is_some() && args.associate == AssociateArg::Time;
        if by_time && pairs.len() < 2 {
            bail!(
                "{}: {} pose lies within {} s of one of {}; check the clocks, raise --max-diff, or compare row by row with --associate row",
                args.estimate.display(),
                pairs.len(),
                args.max_diff,
                args.truth.display()
            );
        }
        if pairs.len() < estimate.len().max(truth.len()) {
            tell(format_args!(
                "{} has {} poses, {} has {}; {} are compared",
                args.estimate.display(),
                estimate.len(),
                args.truth.display(),
                truth.len(),
                pairs.len()
            ));
        }
        let pose = |pose: &Pose| pose.world_from_camera;
        Ok(Self {
            estimate: pairs.iter().map(|&(i, _)| pose(&estimate[i])).collect(),
            truth: pairs.iter().map(|&(_, j)| pose(&truth[j])).collect(),
            times_s: true_at.or(at).map_or_else(Vec::new, |t| {
                pairs.iter().filter_map(|&(i, j)| t.get(if by_time { j } else { i }).copied()).collect()
            }),
            how: if by_time { "time" } else { "row" },
        })
    }
}

/// Time stamps, where every pose has one.
fn times(poses: &[Pose]) -> Option<Vec<f64>> {
    poses.iter().map(|pose| pose.time_s).collect()
}

/// A trajectory file, the folder of a run, or a recording with true poses.
pub fn poses(path: &Path, format: Option<Format>) -> Result<Vec<Pose>> {
    if !path.is_dir() {
        return Ok(trajectory::read(path, format)?);
    }
    let ours = path.join("trajectory_tum.txt");
    if ours.is_file() {
        return Ok(trajectory::read(&ours, Some(Format::Tum))?);
    }
    let source = Source::open(path)?;
    let frames = source.sequences.first().map(|sequence| &sequence.frames[..]).unwrap_or_default();
    let pose = |frame: &egomotion_io::source::FrameFiles| {
        Some(Pose { time_s: Some(frame.time_s), world_from_camera: frame.truth? })
    };
    let poses: Vec<Pose> = frames.iter().filter_map(pose).collect();
    if poses.is_empty() {
        bail!("{}: the recording has no true poses; give a file with the truth", path.display());
    }
    Ok(poses)
}
