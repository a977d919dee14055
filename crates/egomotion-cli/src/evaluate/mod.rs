//! `egomotion evaluate`: a trajectory against the truth.

mod stated;
mod trajectories;

use std::io::Write as _;

use anyhow::{Result, bail};
use egomotion::geometry::RigidMotion;
use egomotion::metrics::{
    Alignment, Delta, Drift, KITTI_LENGTHS_M, Spread, absolute_errors_m, align, kitti_drift, pairs,
    relative_pose_error, relative_pose_errors,
};
use serde_json::{Value, json};

use crate::args::{AlignArg, EvaluateArgs};
use crate::terminal::{self, tell};
use crate::{Ending, Usage};
use stated::Stated;
use trajectories::Compared;

/// Read both trajectories, lay them over each other, compare, print.
pub fn evaluate(args: &EvaluateArgs) -> Result<Ending> {
    let lengths = args.lengths.clone().unwrap_or_else(|| KITTI_LENGTHS_M.to_vec());
    if let Some(bad) = lengths.iter().find(|l| !(l.is_finite() && **l > 0.0)) {
        return Err(Usage(format!("--lengths: {bad} is not a positive length")).into());
    }
    let compared = Compared::read(args)?;
    let verdict = Verdict::of(args, &compared, lengths)?;
    let mut out = terminal::stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&verdict.json())?)?;
    } else {
        write!(out, "{}", verdict.text())?;
    }
    Ok(Ending::Done)
}

/// Errors of the relative motions over one distance.
struct Over {
    name: String,
    translation_m: Spread,
    rotation_deg: Spread,
}

/// All that is said of a trajectory.
struct Verdict {
    poses: usize,
    how: &'static str,
    step: egomotion::metrics::RelativePoseError,
    over: Vec<Over>,
    lengths: Vec<f64>,
    drift: Option<Drift>,
    alignment: AlignArg,
    scale: f64,
    absolute: Option<Spread>,
    stated: Option<Stated>,
}

impl Verdict {
    fn of(args: &EvaluateArgs, compared: &Compared, lengths: Vec<f64>) -> Result<Self> {
        let truth = &compared.truth;
        let mut alignment = args.align;
        let laid = align(&compared.estimate, truth, alignment.into()).or_else(|| {
            tell(format_args!(
                "the positions lie on a line or a point, and determine no alignment: none is made"
            ));
            alignment = AlignArg::None;
            align(&compared.estimate, truth, Alignment::None)
        });
        let Some(laid) = laid else { bail!("{}: no pose to compare", args.estimate.display()) };
        let aligned: Vec<RigidMotion> = compared.estimate.iter().map(|pose| laid.apply(pose)).collect();
        let Some(step) = relative_pose_error(&aligned, truth) else {
            bail!(
                "{}: {} pose in common with {}; two are needed",
                args.estimate.display(),
                truth.len(),
                args.truth.display()
            );
        };
        let over = |delta: &(String, Delta)| {
            let errors = relative_pose_errors(&aligned, truth, &pairs(delta.1, truth, &compared.times_s));
            let of = |value: fn(&egomotion::metrics::PoseError) -> f64| {
                Spread::of(&errors.iter().map(value).collect::<Vec<_>>())
            };
            let (translation_m, rotation_deg) = (of(|e| e.translation_m)?, of(|e| e.rotation_deg)?);
            Some(Over { name: delta.0.clone(), translation_m, rotation_deg })
        };
        Ok(Self {
            poses: truth.len(),
            how: compared.how,
            step,
            over: args.delta.iter().filter_map(over).collect(),
            drift: kitti_drift(&aligned, truth, &lengths),
            lengths,
            alignment,
            scale: laid.scale,
            absolute: Spread::of(&absolute_errors_m(&aligned, truth)),
            stated: Stated::read(args)?,
        })
    }

    fn json(&self) -> Value {
        let spread = |s: &Spread| {
            json!({ "rmse": s.rmse, "mean": s.mean, "median": s.median, "std": s.std, "min": s.min,
                    "max": s.max, "sse": s.sse })
        };
        let over = |o: &Over| {
            json!({ "delta": o.name, "pairs": o.translation_m.count,
                    "translation_m": spread(&o.translation_m), "rotation_deg": spread(&o.rotation_deg) })
        };
        json!({
            "frames": self.poses,
            "associated_by": self.how,
            "t_rmse_m": self.step.t_rmse_m,
            "t_median_m": self.step.t_median_m,
            "t_max_m": self.step.t_max_m,
            "r_rmse_deg": self.step.r_rmse_deg,
            "r_median_deg": self.step.r_median_deg,
            "drift_percent": self.drift.map(|d| d.percent),
            "drift_deg_per_m": self.drift.map(|d| d.deg_per_m),
            "segments": self.drift.map_or(0, |d| d.segments),
            "relative": self.over.iter().map(over).collect::<Vec<_>>(),
            "alignment": self.alignment.name(),
            "scale": self.scale,
            "absolute_m": self.absolute.as_ref().map(spread),
            "stated": self.stated.as_ref().map(Stated::json),
        })
    }

    fn text(&self) -> String {
        let mut text = format!("{} poses, associated by {}\n", self.poses, self.how);
        let step = &self.step;
        text += &format!(
            "frame to frame: {:.3} mm, {:.5}° (root mean square); {:.3} mm, {:.5}° (median)\n",
            1e3 * step.t_rmse_m,
            step.r_rmse_deg,
            1e3 * step.t_median_m,
            step.r_median_deg
        );
        for over in &self.over {
            text += &format!(
                "over {}: {:.3} mm, {:.5}° (root mean square of {} pairs)\n",
                over.name,
                1e3 * over.translation_m.rmse,
                over.rotation_deg.rmse,
                over.translation_m.count
            );
        }
        text += &match self.drift {
            Some(drift) => format!(
                "drift: {:.3} %, {:.5} °/m over {} segments of {:?} m\n",
                drift.percent, drift.deg_per_m, drift.segments, self.lengths
            ),
            None => format!(
                "drift: the path is shorter than {:?} m; choose others with --lengths\n",
                self.lengths
            ),
        };
        if let Some(absolute) = &self.absolute {
            let scale = if self.alignment == AlignArg::Sim3 {
                format!(", scale {:.5}", self.scale)
            } else {
                String::new()
            };
            text += &format!(
                "position, {}: {:.4} m (root mean square), {:.4} m (largest){scale}\n",
                self.alignment.words(),
                absolute.rmse,
                absolute.max
            );
        }
        if let Some(stated) = &self.stated {
            text += &stated.text();
        }
        text
    }
}
