//! Time to impact of the nearest obstacle over time with its 95 % interval, and the reason where there is none.

use egomotion::motion::NoObstacle;
use maud::{Markup, html};

use super::charts::{cursor, line, time_scale, unanswered, view_box};
use super::interval::Interval;
use super::report::{FrameRow, Report};
use super::time_series::TimeSeries;
use super::timeline::Timeline;
use crate::chart::axes::{Axes, AxisScale, MARGIN, extent};

/// Width and height of the chart, in SVG units, which are pixels on a phone.
const CHART_SIZE: (f64, f64) = (400.0, 250.0);
/// Height of the lane of one reason, in SVG units: its letter fits beside it.
const LANE_HEIGHT: f64 = 15.0;

/// Time to impact over time.
pub(crate) fn series(timeline: &Timeline<'_>) -> TimeSeries {
    TimeSeries {
        id: "impact".into(),
        name: "Time to impact".into(),
        unit: "s".into(),
        values: timeline.rows.iter().map(|row| row.impact()).collect(),
        truths: vec![None; timeline.rows.len()],
    }
}

/// Why a row has no time to impact; `None` if it has one, or no motion either.
fn reason(row: &FrameRow) -> Option<NoObstacle> {
    match (row.impact(), row.obstacle, &row.motion) {
        (None, Err(why), Some(_)) => Some(why),
        (None, Ok(_), Some(_)) => Some(NoObstacle::NothingApproaches),
        _ => None,
    }
}

/// The reasons that occur, each with how often among all rows.
pub(crate) fn reasons(rows: &[FrameRow]) -> Vec<(NoObstacle, usize)> {
    let mut reasons: Vec<(NoObstacle, usize)> = Vec::new();
    for why in rows.iter().filter_map(reason) {
        match reasons.iter_mut().find(|(known, _)| *known == why) {
            Some((_, count)) => *count += 1,
            None => reasons.push((why, 1)),
        }
    }
    reasons.sort_by_key(|(why, _)| letter(*why));
    reasons
}

/// The chart with a lane below for each reason; `None` if nothing ever approaches.
pub(crate) fn chart(
    timeline: &Timeline<'_>,
    series: &TimeSeries,
    reasons: &[(NoObstacle, usize)],
) -> Option<Markup> {
    let axes = Axes {
        x: time_scale(timeline, CHART_SIZE),
        y: AxisScale::log(range(series)?, (CHART_SIZE.1 - MARGIN[3], MARGIN[2])),
    };
    let [left, top, width, height] = axes.inside();
    let bars = |open: bool| -> String {
        let values = timeline.times.iter().zip(&series.values);
        values.filter_map(|(&t, v)| bar(t, (*v).filter(|v| v.high.is_infinite() == open)?, &axes)).collect()
    };
    let bar_px = (0.6 * width / timeline.times.len().max(1) as f64).clamp(1.0, 9.0);
    let whole = (CHART_SIZE.0, CHART_SIZE.1 + LANE_HEIGHT * reasons.len() as f64);
    Some(html! {
        svg viewBox=(view_box(whole)) role="img" aria-label="time to impact of the nearest obstacle over time" data-series=(series.id)
            data-inside=(format!("{left:.1} {width:.1}")) data-range=(format!("{:.4} {:.4}", axes.x.range().0, axes.x.range().1)) {
            (axes.grid(timeline.name, "", (6, 6)))
            clipPath id="clip-impact" { rect x=(left) y=(top) width=(width) height=(height) {} }
            g clip-path="url(#clip-impact)" {
                path class="interval" stroke-width=(format!("{bar_px:.1}")) d=(bars(false)) {}
                path class="interval open" stroke-width=(format!("{bar_px:.1}")) d=(bars(true)) {}
                path class="line" d=(line(timeline, &axes, series.values.iter().map(|v| v.map(|v| v.value)))) {}
                @if timeline.times.len() <= 80 {
                    @for (&t, value) in timeline.times.iter().zip(&series.values) {
                        @if let Some((x, y)) = value.and_then(|v| axes.at(t, v.value)) { circle class="dot" cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="2.4" {} }
                    }
                }
            }
            @for (k, (why, _)) in reasons.iter().enumerate() { (lane(timeline, &axes, *why, CHART_SIZE.1 + LANE_HEIGHT * k as f64 + 2.0, bar_px)) }
            (unanswered(timeline, &axes))
            (cursor(timeline, &axes))
        }
    })
}

/// Marks at the rows without an obstacle for one reason; the legend names it by its letter.
fn lane(timeline: &Timeline<'_>, axes: &Axes, why: NoObstacle, y: f64, width_px: f64) -> Markup {
    let at = timeline.times.iter().zip(&timeline.rows).filter(|(_, row)| reason(row) == Some(why));
    let d: String = at.filter_map(|(&t, _)| Some(format!("M{:.1} {y:.1}v9", axes.x.at(t)?))).collect();
    let [left, _, width, _] = axes.inside();
    html! {
        path class="rule" d=(format!("M{left:.1} {:.1}h{width:.1}", y + 4.5)) {}
        path class="reason" stroke-width=(format!("{width_px:.1}")) d=(d) {}
        text x=(format!("{:.1}", left - 5.0)) y=(format!("{:.1}", y + 8.5)) text-anchor="end" { (letter(why)) }
    }
}

/// The letter that stands for a reason in the chart.
pub(crate) fn letter(why: NoObstacle) -> &'static str {
    match why {
        NoObstacle::NothingMeasured => "a",
        NoObstacle::NothingApproaches => "b",
        NoObstacle::NothingCrosses => "c",
        NoObstacle::OnlyScattered => "d",
    }
}

/// How often there was no obstacle, and why; `None` if there always was one.
pub(crate) fn none(report: &Report<'_>, reasons: &[(NoObstacle, usize)]) -> Option<String> {
    let answered = report.frames.iter().filter(|row| row.motion.is_some()).count();
    let total: usize = reasons.iter().map(|(_, count)| count).sum();
    let listed: Vec<String> =
        reasons.iter().map(|(why, count)| format!("{} – {why} ({count})", letter(*why))).collect();
    (total > 0).then(|| format!("No obstacle in {total} of {answered} intervals: {}.", listed.join("; ")))
}

/// From the earliest to the latest that matters: slow approaches do not press the near ones flat.
fn range(series: &TimeSeries) -> Option<(f64, f64)> {
    let present = || series.values.iter().flatten();
    let (soonest, _) = extent(present().map(|a| a.low))?;
    let (first, last) = extent(present().map(|a| a.value))?;
    let (_, high) = extent(present().map(|a| a.high)).unwrap_or((last, last));
    let top = high.max(last).min(4.0 * last).min(50.0 * first).max(1.5 * first);
    Some((0.85 * soonest.max(first / 20.0), 1.15 * top))
}

/// A vertical stroke over the interval, to the upper edge where it is open.
fn bar(time: f64, value: Interval, axes: &Axes) -> Option<String> {
    let (x, low) = axes.at(time, value.low)?;
    let high = if value.high.is_finite() { axes.y.at(value.high)? } else { axes.inside()[1] };
    Some(format!("M{x:.1} {low:.1}V{high:.1}"))
}
