//! What moves by itself and what is met first, outlined in the image, with a line of text each.

use egomotion::geometry::PixelBounds;
use egomotion::pipeline::MovingGroup;
use maud::{Markup, html};

use super::interval::Interval;
use super::report::{FrameRow, Report};
use super::slider::SliderPosition;
use crate::chart::number::significant;

/// Most groups that are outlined in a frame, the largest first: with more the image is hidden.
const MAX_GROUPS: usize = 8;

/// Outlines on the image, in its own pixels; the script shows those of one frame.
pub(crate) fn overlay(report: &Report<'_>, positions: &[SliderPosition]) -> Markup {
    let (width, height) = (report.rig.width_px, report.rig.height_px);
    // Text as large as in a chart when the image is shown small.
    let font = width as f64 / 34.0;
    html! {
        svg class="overlay" viewBox=(format!("0 0 {width} {height}")) aria-hidden="true" style=(format!("font-size:{font:.0}px")) {
            @for (k, position) in positions.iter().enumerate() {
                @if let Some(row) = report.frames.get(position.row) {
                    g data-k=(k) class=(if k == 0 { "on" } else { "" }) {
                        @if let Ok(obstacle) = row.obstacle { (outline("obstacle", obstacle.bounds, "", font)) }
                        @for (n, group) in row.moving.iter().take(MAX_GROUPS).enumerate() {
                            (outline("moving", group.bounds, &(n + 1).to_string(), font))
                        }
                    }
                }
            }
        }
    }
}

fn outline(class: &str, bounds: PixelBounds, label: &str, font: f64) -> Markup {
    let PixelBounds { u, v, width, height } = bounds;
    // A label above the frame, or inside it at the image's upper edge.
    let baseline = if (v as f64) < 1.1 * font { v as f64 + font } else { v as f64 - 0.25 * font };
    html! {
        rect class=(class) x=(u) y=(v) width=(width) height=(height) {}
        @if !label.is_empty() { text x=(u) y=(format!("{baseline:.0}")) { (label) } }
    }
}

/// The same in words, a list a frame.
pub(crate) fn words(report: &Report<'_>, positions: &[SliderPosition]) -> Markup {
    html! {
        @for (k, position) in positions.iter().enumerate() {
            @if let Some(row) = report.frames.get(position.row) {
                ul data-k=(k) class=(if k == 0 { "on" } else { "" }) {
                    li class=(if row.impact().is_some() { "obstacle" } else { "" }) { (nearest(row)) }
                    @for (n, group) in row.moving.iter().take(MAX_GROUPS).enumerate() {
                        li class="moving" { b { (n + 1) } ": " (moving(row, group)) }
                    }
                    @if row.moving.len() > MAX_GROUPS { li { "and " (row.moving.len() - MAX_GROUPS) " smaller ones" } }
                }
            }
        }
    }
}

fn nearest(row: &FrameRow) -> String {
    match (row.impact(), row.obstacle) {
        (Some(seconds), _) => format!("Nearest obstacle: {}", in_seconds(&seconds)),
        (None, Err(why)) => format!("No obstacle: {why}"),
        (None, Ok(_)) => "No obstacle: nothing approaches".into(),
    }
}

fn moving(row: &FrameRow, group: &MovingGroup) -> String {
    let vz = row.interval_s().map_or(String::new(), |dt| {
        let (value, sigma) = (group.depth_velocity.value() / dt, group.depth_velocity.sigma(0) / dt);
        format!(", VZ {} ± {} m/s", significant(value, 3), significant(2.0 * sigma, 2))
    });
    let impact = group.impact.as_ref().and_then(Interval::of_impact);
    let impact =
        impact.map_or("comes no nearer".into(), |seconds| format!("reached {}", in_seconds(&seconds)));
    format!("{} m away{vz}, {impact}", significant(group.depth_m, 3))
}

/// When something is reached, with its interval.
pub(crate) fn in_seconds(seconds: &Interval) -> String {
    let (value, low) = (significant(seconds.value, 3), significant(seconds.low, 3));
    match seconds.high.is_finite() {
        true => format!("in {value} s ({low} … {} s)", significant(seconds.high, 3)),
        false => format!("in {value} s (not before {low} s)"),
    }
}
