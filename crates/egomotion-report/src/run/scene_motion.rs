//! φ as in `motion.csv`: the scene's motion from frame to frame, and against truth how far off it is.

use egomotion::geometry::Twist;
use maud::{Markup, html};

use super::charts::{self, COMPONENT_CHART_SIZE, ERROR_CHART_SIZE};
use super::interval::Interval;
use super::report::FrameRow;
use super::time_series::TimeSeries;
use super::timeline::Timeline;
use crate::chart::number::{DEGREES, Unit, length, significant};

/// The components of φ and what a positive value means.
const COMPONENTS: [(&str, &str, &str); 6] = [
    ("t", "X", "positive: the scene shifts right"),
    ("t", "Y", "positive: the scene shifts down"),
    ("t", "Z", "negative: the scene comes nearer"),
    ("Ω", "X", "positive: the camera nods down"),
    ("Ω", "Y", "positive: the camera turns left"),
    ("Ω", "Z", "positive: the camera leans left"),
];

/// The six components over time.
pub(crate) fn series(timeline: &Timeline<'_>) -> Vec<TimeSeries> {
    let shifts = timeline.rows.iter().flat_map(|row| (0..3).filter_map(|i| row.component(i)));
    let metres = length(shifts.map(|(v, _)| v.abs()).fold(0.0, f64::max));
    let one = |(i, (symbol, axis, _)): (usize, (&str, &str, &str))| {
        let unit: Unit = if i < 3 { metres } else { DEGREES };
        let value = |row: &&FrameRow| {
            row.component(i).map(|(v, s)| Interval::around(v * unit.factor, s * unit.factor))
        };
        let truth = |row: &&FrameRow| Some(Twist::vector(&row.truth?)[i] * unit.factor);
        TimeSeries {
            id: format!("phi-{i}"),
            name: format!("{symbol}{axis}"),
            unit: unit.name.to_owned(),
            values: timeline.rows.iter().map(value).collect(),
            truths: timeline.rows.iter().map(truth).collect(),
        }
    };
    COMPONENTS.into_iter().enumerate().map(one).collect()
}

/// The six charts; `errors` below them where there is truth.
pub(crate) fn charts(timeline: &Timeline<'_>, all: &[TimeSeries]) -> Markup {
    html! {
        div class="charts" {
            @for ((symbol, axis, sign), series) in COMPONENTS.into_iter().zip(all) {
                figure {
                    figcaption {
                        b { (symbol) sub { (axis) } } " " span class="unit" { (series.unit) " per interval" }
                        span class="sign" {
                            (sign)
                            @if series.usual_band().is_finite() { "; known to ±" (significant(series.usual_band(), 2)) " " (series.unit) }
                        }
                    }
                    (charts::chart(timeline, series, &charts::axes(timeline, charts::value_range(series), COMPONENT_CHART_SIZE), COMPONENT_CHART_SIZE))
                    @if let Some(errors) = series.errors() {
                        span class="sign" { "estimate − truth, against the same band" }
                        (charts::chart(timeline, &errors, &charts::axes(timeline, charts::error_range(&errors), ERROR_CHART_SIZE), ERROR_CHART_SIZE))
                    }
                }
            }
        }
    }
}
