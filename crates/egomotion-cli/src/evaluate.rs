//! `egomotion evaluate`: a trajectory against the truth.

use std::io::Write as _;

use anyhow::{Result, bail};
use egomotion::geometry::RigidMotion;
use egomotion::metrics::{KITTI_LENGTHS_M, kitti_drift, relative_pose_error};
use egomotion_io::trajectory::{Format, read};

use crate::args::{EvaluateArgs, FormatArg};
use crate::terminal::{self, tell};
use crate::{Ending, Usage};

/// Read both trajectories, compare them row by row, print.
pub fn evaluate(args: &EvaluateArgs) -> Result<Ending> {
    let format = args.format.map(|format| match format {
        FormatArg::Tum => Format::Tum,
        FormatArg::Kitti => Format::Kitti,
    });
    let lengths = args.lengths.clone().unwrap_or_else(|| KITTI_LENGTHS_M.to_vec());
    if let Some(bad) = lengths.iter().find(|l| !(l.is_finite() && **l > 0.0)) {
        return Err(Usage(format!("--lengths: {bad} is not a positive length")).into());
    }
    let poses = |path| -> Result<Vec<RigidMotion>> {
        Ok(read(path, format)?.into_iter().map(|pose| pose.world_from_camera).collect())
    };
    let (mut estimate, mut truth) = (poses(&args.estimate)?, poses(&args.truth)?);
    if estimate.len() != truth.len() {
        tell(format_args!(
            "{} has {} poses, {} has {}; the first {} of both are compared",
            args.estimate.display(),
            estimate.len(),
            args.truth.display(),
            truth.len(),
            estimate.len().min(truth.len())
        ));
    }
    let count = estimate.len().min(truth.len());
    estimate.truncate(count);
    truth.truncate(count);
    let Some(step) = relative_pose_error(&estimate, &truth) else {
        bail!(
            "{}: {count} pose in common with {}; two are needed",
            args.estimate.display(),
            args.truth.display()
        );
    };
    let drift = kitti_drift(&estimate, &truth, &lengths);
    let mut out = terminal::stdout();
    if args.json {
        let report = serde_json::json!({
            "frames": count,
            "t_rmse_m": step.t_rmse_m,
            "t_median_m": step.t_median_m,
            "t_max_m": step.t_max_m,
            "r_rmse_deg": step.r_rmse_deg,
            "r_median_deg": step.r_median_deg,
            "drift_percent": drift.map(|d| d.percent),
            "drift_deg_per_m": drift.map(|d| d.deg_per_m),
            "segments": drift.map_or(0, |d| d.segments),
        });
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
        return Ok(Ending::Done);
    }
    writeln!(out, "{count} poses")?;
    writeln!(
        out,
        "frame to frame: {:.3} mm, {:.5}° (root mean square); {:.3} mm, {:.5}° (median)",
        1e3 * step.t_rmse_m,
        step.r_rmse_deg,
        1e3 * step.t_median_m,
        step.r_median_deg
    )?;
    match drift {
        Some(drift) => writeln!(
            out,
            "drift: {:.3} %, {:.5} °/m over {} segments of {lengths:?} m",
            drift.percent, drift.deg_per_m, drift.segments
        )?,
        None => writeln!(out, "drift: the path is shorter than {lengths:?} m; choose others with --lengths")?,
    }
    Ok(Ending::Done)
}
