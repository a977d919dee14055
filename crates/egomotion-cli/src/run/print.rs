//! What a run says on standard output when it ends.

use std::io::Write as _;
use std::path::Path;

use anyhow::{Context, Result};

use crate::results::{PairSummary, Summary};
use crate::terminal;

/// Say that nothing is left to do in a folder; as `json` by the summary that is there.
pub fn print_complete_before(out: &Path, json: bool) -> Result<()> {
    let mut stdout = terminal::stdout();
    if json {
        let summary = out.join("summary.json");
        stdout.write_all(&std::fs::read(&summary).with_context(|| summary.display().to_string())?)?;
    } else {
        writeln!(stdout, "{}: the run is complete, nothing is left to do", out.display())?;
    }
    Ok(())
}

/// One sequence in a few lines.
pub fn print_summary(summary: &Summary, out: &Path) -> Result<()> {
    let mut stdout = terminal::stdout();
    writeln!(
        stdout,
        "{}: {} frames, {} of {} motions answered, {:.1} ms a frame",
        out.display(),
        summary.frames,
        summary.answered(),
        summary.frames.saturating_sub(1),
        summary.frame_ms
    )?;
    if let Some(truth) = &summary.truth {
        writeln!(
            stdout,
            "  against the source's poses, frame to frame: {:.2} mm, {:.4}° (root mean square)",
            1e3 * truth.t_rmse_m,
            truth.r_rmse_deg
        )?;
    }
    if let Some(maps) = &summary.truth_maps {
        writeln!(
            stdout,
            "  against the source's maps: VZ median error {:.3} m, {:.1} % within 2σ, {:.1} % answered; disparity {:.1} % off by more than 3 px or missing",
            maps.vz_median_abs_error_m,
            100.0 * maps.vz_within_2_sigma,
            100.0 * maps.answered,
            100.0 * maps.disparity_bad_3px
        )?;
    }
    Ok(())
}

/// One pair without a second time in a few lines.
pub fn print_pair(summary: &PairSummary, out: &Path) -> Result<()> {
    let mut stdout = terminal::stdout();
    let unit = match summary.rig {
        Some(_) => "",
        None => " in pixels, for want of a calibration",
    };
    writeln!(
        stdout,
        "{}: a pair of one time: disparity{unit}, no motion; {:.1} ms",
        out.display(),
        summary.frame_ms
    )?;
    if let Some(verdict) = &summary.disparity {
        writeln!(
            stdout,
            "  against the true disparity: {:.1} % off by more than 1 px or missing, {:.1} % by 3 px; median {:.3} px; {:.1} % within 2σ",
            100.0 * verdict.bad_1px,
            100.0 * verdict.bad_3px,
            verdict.median_abs_error_px,
            100.0 * verdict.within_2_sigma
        )?;
    }
    Ok(())
}
