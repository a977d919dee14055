//! Which components of the motion could be determined, and how many measurements spoke for it.

use maud::{Markup, html};

use super::charts::{cursor, line, time_scale, unanswered, view_box};
use super::interval::Interval;
use super::report::{FrameRow, Report};
use super::time_series::TimeSeries;
use super::timeline::Timeline;
use crate::chart::axes::{Axes, AxisScale, MARGIN, extent};
use crate::chart::number::significant;

/// Width and height of the chart of measurements, in SVG units, which are pixels on a phone.
const CHART_SIZE: (f64, f64) = (400.0, 170.0);
/// Height of the lane of one component, in SVG units: its name fits beside it.
const LANE_HEIGHT: f64 = 20.0;

/// The components in φ's order, as a driver would name them.
const COMPONENT_NAMES: [&str; 6] = ["sideways", "up and down", "forward", "pitch", "yaw", "roll"];

/// The measurements that were kept, in thousands where they are many; the band goes up to all.
pub(crate) fn series(timeline: &Timeline<'_>) -> TimeSeries {
    let most = timeline.rows.iter().filter_map(|row| Some(row.motion.as_ref()?.rows)).max().unwrap_or(0);
    let (factor, unit) = if most >= 10_000 { (1e-3, "thousand") } else { (1.0, "") };
    let value = |row: &&FrameRow| {
        let motion = row.motion.as_ref()?;
        let [kept, all] = [motion.inliers, motion.rows].map(|n| factor * n as f64);
        Some(Interval { value: kept, low: kept, high: all })
    };
    TimeSeries {
        id: "kept".into(),
        name: "Measurements kept, and all".into(),
        unit: unit.into(),
        values: timeline.rows.iter().map(value).collect(),
        truths: vec![None; timeline.rows.len()],
    }
}

/// One sentence on the measurements.
pub(crate) fn sentence(report: &Report<'_>) -> Option<String> {
    let motions = || report.frames.iter().filter_map(|row| row.motion.as_ref());
    let of = |n: &dyn Fn(&egomotion::estimate::MotionEstimate) -> usize| {
        let mut all: Vec<f64> = motions().map(|motion| n(motion) as f64).collect();
        egomotion::geometry::median(&mut all)
    };
    let (rows, kept) = (of(&|m| m.rows), of(&|m| m.inliers));
    (rows > 0.0).then(|| {
        format!(
            "In the middle frame {rows:.0} measurements ask for the motion, and {} % of them agree with it; the others are wrong matches or things that move by themselves.",
            significant(100.0 * kept / rows, 2)
        )
    })
}

/// Kept measurements over time, between zero and all.
pub(crate) fn measurements(timeline: &Timeline<'_>, series: &TimeSeries) -> Markup {
    let top = extent(series.values.iter().flatten().map(|v| v.high)).map_or(1.0, |(_, hi)| 1.1 * hi);
    let axes = Axes {
        x: time_scale(timeline, CHART_SIZE),
        y: AxisScale::linear((0.0, top), (CHART_SIZE.1 - MARGIN[3], MARGIN[2])),
    };
    let [left, _, width, _] = axes.inside();
    html! {
        svg viewBox=(view_box(CHART_SIZE)) role="img" aria-label="measurements over time" data-series=(series.id)
            data-inside=(format!("{left:.1} {width:.1}")) data-range=(format!("{:.4} {:.4}", axes.x.range().0, axes.x.range().1)) {
            (axes.grid(timeline.name, "", (6, 4)))
            path class="all" d=(line(timeline, &axes, series.values.iter().map(|v| v.map(|v| v.high)))) {}
            path class="line" d=(line(timeline, &axes, series.values.iter().map(|v| v.map(|v| v.value)))) {}
            (unanswered(timeline, &axes))
            (cursor(timeline, &axes))
        }
    }
}

/// How often each component was determined among the answered intervals.
fn counts(rows: &[FrameRow]) -> ([usize; 6], usize) {
    let observed = || rows.iter().filter_map(|row| row.motion.as_ref()).map(|motion| motion.observed);
    (std::array::from_fn(|i| observed().filter(|o| o[i]).count()), observed().count())
}

/// A lane for each component, filled where it was determined, with how often in words.
pub(crate) fn lanes(report: &Report<'_>, timeline: &Timeline<'_>) -> Markup {
    let (counts, answered) = counts(report.frames);
    // Room for the words at the left, and for how often, at 6.5 a character, at the right.
    let said = |count: usize| format!("{count} of {answered}");
    let (left, right) = (84.0, CHART_SIZE.0 - 10.0 - 6.5 * said(answered).len() as f64);
    let axes = Axes {
        x: AxisScale::linear(timeline.range, (left, right)),
        y: AxisScale::linear((0.0, 6.0), (6.0 * LANE_HEIGHT, 0.0)),
    };
    let wide = ((right - left) / timeline.times.len().max(1) as f64).max(0.6);
    let marks = |i: usize, wanted: bool| -> String {
        let there = |row: &FrameRow| row.motion.as_ref().is_some_and(|motion| motion.observed[i] == wanted);
        let rows = timeline.times.iter().zip(&timeline.rows).filter(|(_, row)| there(row));
        let top = LANE_HEIGHT * i as f64 + 4.0;
        rows.filter_map(|(&t, _)| Some(format!("M{:.1} {top:.0}v12", axes.x.at(t)?))).collect()
    };
    html! {
        svg viewBox=(view_box((CHART_SIZE.0, 6.0 * LANE_HEIGHT + 2.0))) role="img" aria-label="which components were determined, over time" {
            @for (i, word) in COMPONENT_NAMES.iter().enumerate() {
                text x=(format!("{:.1}", left - 6.0)) y=(format!("{:.1}", LANE_HEIGHT * i as f64 + 14.0)) text-anchor="end" { (word) }
                path class="determined" stroke-width=(format!("{wide:.2}")) d=(marks(i, true)) {}
                path class="undetermined" stroke-width=(format!("{wide:.2}")) d=(marks(i, false)) {}
                text x=(format!("{:.1}", right + 6.0)) y=(format!("{:.1}", LANE_HEIGHT * i as f64 + 14.0)) { (said(counts[i])) }
            }
            (cursor(timeline, &axes))
        }
    }
}

/// What could not be determined, in words, with how often; the most frequent first.
pub(crate) fn undetermined(rows: &[FrameRow]) -> Vec<(String, usize)> {
    let mut free: Vec<(String, usize)> = Vec::new();
    for motion in rows.iter().filter_map(|row| row.motion.as_ref()).filter(|m| !m.is_complete()) {
        let words = motion.undetermined.to_string();
        match free.iter_mut().find(|(known, _)| *known == words) {
            Some((_, count)) => *count += 1,
            None => free.push((words, 1)),
        }
    }
    free.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    free
}
