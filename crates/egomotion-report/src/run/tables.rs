//! Milliseconds by stage, and the table of frames.

use maud::{Markup, html};

use super::report::{FrameRow, Report};
use crate::chart::number::{DEGREES, fixed, length, significant, with_sigma};

/// Most rows of the table, so that a browser lays it out at once; all are in `motion.csv`.
const MAX_ROWS: usize = 1000;

/// One bar for each stage, and what is left of the whole.
pub(crate) fn stages(report: &Report<'_>) -> Markup {
    let mut stages: Vec<(&str, f64)> =
        report.stages_ms.iter().copied().filter(|(_, ms)| ms.is_finite() && *ms >= 0.0).collect();
    let sum: f64 = stages.iter().map(|(_, ms)| ms).sum();
    let rest = report.frame_ms - sum;
    if rest.is_finite() && rest > 0.005 * sum {
        stages.push(("everything else", rest));
    }
    let longest = stages.iter().map(|(_, ms)| *ms).fold(f64::MIN_POSITIVE, f64::max);
    html! {
        table class="stages" {
            @for (name, ms) in &stages {
                tr {
                    th scope="row" { (name) }
                    td { div class="bar" style=(format!("width:{:.2}%", 100.0 * (ms / longest))) {} }
                    td class="ms" { (fixed(*ms, if *ms < 9.95 { 1 } else { 0 })) " ms" }
                }
            }
        }
    }
}

/// Every frame in numbers.
pub(crate) fn frames(report: &Report<'_>) -> Markup {
    let shown = &report.frames[..report.frames.len().min(MAX_ROWS)];
    let largest = shown.iter().flat_map(|row| (0..3).filter_map(|i| row.component(i)));
    let metres = length(largest.map(|(v, _)| v.abs()).fold(0.0, f64::max));
    html! {
        div class="scroll" {
            table class="frames" {
                thead { tr {
                    th { "frame" } th { "time (s)" } th { "interval (s)" }
                    @for axis in ["X", "Y", "Z"] { th { "t" sub { (axis) } " (" (metres.name) ")" } }
                    @for axis in ["X", "Y", "Z"] { th { "Ω" sub { (axis) } " (°)" } }
                    th { "impact (s), 95 %" } th { "used" } th { "status" }
                } }
                tbody {
                    @for row in shown {
                        tr class=(if row.asks() && row.motion.is_none() { "none" } else { "" }) {
                            td { (row.frame) }
                            td { (fixed(row.time_s, 3)) }
                            td { (row.dt_s.map_or("–".into(), |dt| significant(dt, 4))) }
                            @for i in 0..6 {
                                @let factor = if i < 3 { metres.factor } else { DEGREES.factor };
                                td { (row.component(i).map_or("–".into(), |(v, s)| with_sigma(v * factor, s * factor))) }
                            }
                            td { (impact(row)) }
                            td { (row.motion.map_or("–".into(), |m| format!("{} of {}", m.inliers, m.rows))) }
                            td { (row.status) }
                        }
                    }
                }
            }
        }
        @if shown.len() < report.frames.len() {
            p class="small" { "The first " (shown.len()) " of " (report.frames.len()) " rows; motion.csv holds all." }
        }
    }
}

fn impact(row: &FrameRow) -> String {
    let Some(seconds) = row.impact() else { return "–".into() };
    let high = if seconds.high.is_finite() { significant(seconds.high, 3) } else { "∞".into() };
    format!("{} ({} … {high})", significant(seconds.value, 3), significant(seconds.low, 3))
}
