//! `egomotion evaluate`: a trajectory against the truth.

use std::io::Write as _;

use anyhow::Result;
use egomotion::metrics::TrajectoryAlignment;
use egomotion_io::evaluation::{Evaluation, EvaluationOptions, StatedUncertainty};

use crate::args::EvaluateArgs;
use crate::exit::{Ending, UsageError};
use crate::terminal::{self, print_json, tell};

/// Read both trajectories, lay them over each other, compare, print.
pub fn evaluate(args: &EvaluateArgs) -> Result<Ending> {
    let options = args.options();
    if let Some(bad) = options.lengths_m.iter().find(|l| !(l.is_finite() && **l > 0.0)) {
        return Err(UsageError(format!("--lengths: {bad} is not a positive length")).into());
    }
    let found = Evaluation::of(&args.estimate, &args.truth, &options)?;
    for warning in &found.warnings {
        tell(warning);
    }
    if args.json {
        print_json(&found.json())?;
    } else {
        write!(terminal::stdout(), "{}", text(&found, &options))?;
    }
    Ok(Ending::Done)
}

fn text(found: &Evaluation, options: &EvaluationOptions) -> String {
    let mut text = format!("{} poses, associated by {}\n", found.poses, found.associated_by);
    let step = &found.step;
    text += &format!(
        "frame to frame: {:.3} mm, {:.5}° (root mean square); {:.3} mm, {:.5}° (median)\n",
        1e3 * step.t_rmse_m,
        step.r_rmse_deg,
        1e3 * step.t_median_m,
        step.r_median_deg
    );
    for over in &found.relative {
        text += &format!(
            "over {}: {:.3} mm, {:.5}° (root mean square of {} pairs)\n",
            over.name,
            1e3 * over.translation_m.rmse,
            over.rotation_deg.rmse,
            over.translation_m.count
        );
    }
    text += &match found.drift {
        Some(drift) => format!(
            "drift: {:.3} %, {:.5} °/m over {} segments of {:?} m\n",
            drift.percent, drift.deg_per_m, drift.segments, options.lengths_m
        ),
        None => format!(
            "drift: the path is shorter than {:?} m; choose others with --lengths\n",
            options.lengths_m
        ),
    };
    if let Some(absolute) = &found.absolute_m {
        let scale = if found.alignment == TrajectoryAlignment::Sim3 {
            format!(", scale {:.5}", found.scale)
        } else {
            String::new()
        };
        text += &format!(
            "position, {}: {:.4} m (root mean square), {:.4} m (largest){scale}\n",
            alignment_in_words(found.alignment),
            absolute.rmse,
            absolute.max
        );
    }
    if let Some(stated) = &found.stated {
        text += &stated_uncertainty(stated);
    }
    text
}

fn stated_uncertainty(stated: &StatedUncertainty) -> String {
    format!(
        "stated uncertainty: NEES/6 {:.2}; {:.1} % of {} components in their 95 % interval\n",
        stated.nees.per_degree().unwrap_or(f64::NAN),
        100.0 * stated.components.share().unwrap_or(f64::NAN),
        stated.components.total()
    )
}

fn alignment_in_words(alignment: TrajectoryAlignment) -> &'static str {
    match alignment {
        TrajectoryAlignment::None => "as given",
        TrajectoryAlignment::Se3 => "laid over the truth",
        TrajectoryAlignment::Sim3 => "laid over the truth and scaled",
    }
}
