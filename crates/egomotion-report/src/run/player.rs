//! The bar with slider and play button, and what it says of each frame.

use maud::{Markup, html};

use super::body_velocity;
use super::report::{FrameRow, Report};
use super::slider::SliderPosition;
use crate::chart::number::{count, fixed, significant};

/// The bar; nothing where there is but one place to be.
pub(crate) fn bar(report: &Report<'_>, positions: &[SliderPosition]) -> Markup {
    html! {
        @if positions.len() > 1 {
            div class="player" {
                button type="button" id="play" aria-label="Play" { "▶" }
                input type="range" id="frame" min="0" max=(positions.len() - 1) value="0" step="1" aria-label="Frame";
                output for="frame" { (says(report, positions)) }
            }
            noscript { p class="small" { "The slider needs JavaScript; the pictures below are those of the first frame." } }
        }
    }
}

/// One line for each frame, of which the script shows one.
fn says(report: &Report<'_>, positions: &[SliderPosition]) -> Markup {
    let (times, _) = report.times();
    html! {
        @for (k, position) in positions.iter().enumerate() {
            @if let (Some(row), Some(time)) = (report.frames.get(position.row), times.get(position.row)) {
                span data-k=(k) class=(if k == 0 { "on" } else { "" }) { (line(report, row, before(report, position), *time)) }
            }
        }
    }
}

/// The frame that is pictured.
fn before(report: &Report<'_>, position: &SliderPosition) -> Option<usize> {
    Some(report.album.pictures().get(position.picture?)?.frame)
}

/// The pair of frames: the pictures are those of the earlier one.
fn frames(row: &FrameRow, before: Option<usize>) -> String {
    before.map_or_else(|| format!("frame {}", row.frame), |before| format!("frames {before} → {}", row.frame))
}

fn line(report: &Report<'_>, row: &FrameRow, before: Option<usize>, time: f64) -> String {
    let mut parts = vec![frames(row, before), format!("{} s", fixed(time, 2))];
    let unit = body_velocity::speed_unit(report.frames);
    match body_velocity::speed_m_s(row) {
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
pub(crate) fn shown(report: &Report<'_>, positions: &[SliderPosition]) -> Option<String> {
    let stride = report.album.stride();
    let pictured = positions.iter().any(|position| position.picture.is_some());
    let frames = count(report.frames.len(), "frame", "frames");
    match (pictured, stride) {
        (true, 1) => None,
        (true, n) => Some(format!(
            "Pictures are kept of {} out of {frames}, every {} of those that gave any, so that the page stays small.",
            positions.len(),
            if n == 2 { "second".into() } else { format!("{n}th") }
        )),
        (false, _) if positions.len() + 1 < report.frames.len() => {
            Some(format!("The slider stops at {} evenly spaced frames out of {frames}.", positions.len()))
        }
        (false, _) => None,
    }
}
