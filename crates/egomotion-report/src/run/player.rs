//! The bar with slider and play button, and what it says of each frame.

use maud::{Markup, html};

use super::{FrameRow, Report, Stop, body};
use crate::chart::number::{count, fixed, significant};

/// The bar; nothing where there is but one place to be.
pub fn bar(report: &Report<'_>, stops: &[Stop]) -> Markup {
    html! {
        @if stops.len() > 1 {
            div class="player" {
                button type="button" id="play" aria-label="Play" { "▶" }
                input type="range" id="frame" min="0" max=(stops.len() - 1) value="0" step="1" aria-label="Frame";
                output for="frame" { (says(report, stops)) }
            }
            noscript { p class="small" { "The slider needs JavaScript; the pictures below are those of the first frame." } }
        }
    }
}

/// One line for each frame, of which the script shows one.
fn says(report: &Report<'_>, stops: &[Stop]) -> Markup {
    let (times, _) = report.times();
    html! {
        @for (k, stop) in stops.iter().enumerate() {
            @if let (Some(row), Some(time)) = (report.frames.get(stop.row), times.get(stop.row)) {
                span data-k=(k) class=(if k == 0 { "on" } else { "" }) { (line(report, row, before(report, stop), *time)) }
            }
        }
    }
}

/// The frame that is pictured.
fn before(report: &Report<'_>, stop: &Stop) -> Option<usize> {
    Some(report.album.pictures().get(stop.picture?)?.frame)
}

/// The pair of frames: the pictures are those of the earlier one.
fn frames(row: &FrameRow, before: Option<usize>) -> String {
    before.map_or_else(|| format!("frame {}", row.frame), |before| format!("frames {before} → {}", row.frame))
}

fn line(report: &Report<'_>, row: &FrameRow, before: Option<usize>, time: f64) -> String {
    let mut parts = vec![frames(row, before), format!("{} s", fixed(time, 2))];
    let unit = body::speed_unit(report.frames);
    match body::speed_m_s(row) {
        Some(speed) => parts.push(format!("{} {}/s", significant(speed * unit.factor, 3), unit.name)),
        None if row.motion.is_none() => parts.push("no answer".into()),
        None => {}
    }
    if let Some(impact) = row.impact() {
        parts.push(format!("impact {} s", significant(impact.value, 2)));
    }
    parts.join(" · ")
}

/// How many frames can be looked at, and why not all.
pub fn shown(report: &Report<'_>, stops: &[Stop]) -> Option<String> {
    let stride = report.album.stride();
    let pictured = stops.iter().any(|stop| stop.picture.is_some());
    let frames = count(report.frames.len(), "frame", "frames");
    match (pictured, stride) {
        (true, 1) => None,
        (true, n) => Some(format!(
            "Pictures are kept of {} out of {frames}, every {} of those that gave any, so that the page stays small.",
            stops.len(),
            if n == 2 { "second".into() } else { format!("{n}th") }
        )),
        (false, _) if stops.len() + 1 < report.frames.len() => {
            Some(format!("The slider stops at {} evenly spaced frames out of {frames}.", stops.len()))
        }
        (false, _) => None,
    }
}
