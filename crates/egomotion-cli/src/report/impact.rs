//! Time to impact of the nearest obstacle over time, with its 95 % interval.

use egomotion::motion::NoObstacle;
use maud::{Markup, html};

use super::Report;
use super::charts::{clip_path, cursor, time_axes, unanswered, vertical, view_box};
use crate::chart::plot::{Axes, Scale, extent, path};

/// Width and height of the chart, in SVG units.
const SIZE: (f64, f64) = (380.0, 375.0);

/// One frame's answer: when, how long, and from when to when.
struct Answer {
    time: f64,
    seconds: f64,
    low: f64,
    /// Infinite where the obstacle may not approach at all.
    high: f64,
}

/// The chart; `None` if nothing ever approaches.
pub fn chart(report: &Report<'_>) -> Option<Markup> {
    let (times, x_name) = report.abscissa();
    let answers: Vec<Option<Answer>> =
        report.frames.iter().zip(&times).map(|(row, &t)| answer(row, t)).collect();
    let y = Scale::log(range(&answers)?, vertical(SIZE));
    let axes = time_axes(&times, SIZE, y);
    let intervals = |open: bool| -> String {
        answers
            .iter()
            .flatten()
            .filter(|a| a.high.is_infinite() == open)
            .filter_map(|a| bar(a, &axes))
            .collect()
    };
    let bar_px = (0.6 * axes.inside()[2] / times.len().max(1) as f64).clamp(1.0, 9.0);
    let points = answers.iter().map(|a| a.as_ref().and_then(|a| axes.at(a.time, a.seconds)));
    let dots = answers.len() <= 80;
    Some(html! {
        svg viewBox=(view_box(SIZE)) role="img" aria-label="time to impact of the nearest obstacle" {
            (axes.grid(x_name, "", (6, 7)))
            (clip_path("clip-impact", &axes))
            g clip-path="url(#clip-impact)" {
                path class="interval" stroke-width=(format!("{bar_px:.1}")) d=(intervals(false)) {}
                path class="interval open" stroke-width=(format!("{bar_px:.1}")) d=(intervals(true)) {}
                path class="line" d=(path(points.clone())) {}
                @if dots {
                    @for (x, y) in points.flatten() { circle class="dot" cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="2.6" {} }
                }
            }
            (unanswered(report, &times, &axes))
            (cursor(report, &times, &axes))
        }
    })
}

/// How often there was no obstacle, and why; `None` if there always was one.
pub fn none(report: &Report<'_>) -> Option<String> {
    let answered: Vec<_> = report.frames.iter().filter(|row| row.motion.is_some()).collect();
    let mut reasons: Vec<(NoObstacle, usize)> = Vec::new();
    for why in answered.iter().filter_map(|row| row.impact.err()) {
        match reasons.iter_mut().find(|(known, _)| *known == why) {
            Some((_, count)) => *count += 1,
            None => reasons.push((why, 1)),
        }
    }
    let total: usize = reasons.iter().map(|(_, count)| count).sum();
    let listed: Vec<String> = reasons.iter().map(|(why, count)| format!("{why} ({count})")).collect();
    (total > 0)
        .then(|| format!("No obstacle in {total} of {} intervals: {}.", answered.len(), listed.join("; ")))
}

fn answer(row: &super::FrameRow, time: f64) -> Option<Answer> {
    let impact = row.impact.ok()?;
    let (seconds, (low, high)) = impact.seconds().zip(impact.interval95_s())?;
    (seconds.is_finite() && low.is_finite() && !high.is_nan()).then_some(Answer { time, seconds, low, high })
}

/// From the earliest to the latest that matters: slow approaches do not press the near ones flat.
fn range(answers: &[Option<Answer>]) -> Option<(f64, f64)> {
    let present = || answers.iter().flatten();
    let (soonest, _) = extent(present().map(|a| a.low))?;
    let (first, last) = extent(present().map(|a| a.seconds))?;
    let (_, high) = extent(present().map(|a| a.high)).unwrap_or((last, last));
    let top = high.max(last).min(4.0 * last).min(50.0 * first).max(1.5 * first);
    Some((0.85 * soonest.max(first / 20.0), 1.15 * top))
}

/// A vertical stroke over the interval, to the upper edge where it is open.
fn bar(answer: &Answer, axes: &Axes) -> Option<String> {
    let (x, low) = axes.at(answer.time, answer.low)?;
    let high = if answer.high.is_finite() { axes.y.at(answer.high)? } else { axes.inside()[1] };
    Some(format!("M{x:.1} {low:.1}V{high:.1}"))
}
