//! Charts over time: a curve with its band, truth, gaps, and the mark that follows the slider.

use egomotion::metrics::quantile;
use maud::{Markup, html};

use super::interval::Interval;
use super::time_series::TimeSeries;
use super::timeline::Timeline;
use crate::chart::axes::{Axes, AxisScale, MARGIN, band, extent, path};

/// Width and height of the chart of one component, in SVG units, which are pixels on a phone.
pub(crate) const COMPONENT_CHART_SIZE: (f64, f64) = (340.0, 180.0);
/// Width and height of the chart of its errors below it, in SVG units.
pub(crate) const ERROR_CHART_SIZE: (f64, f64) = (340.0, 100.0);

/// One series over time; `y` is made by the caller so that charts may share it.
pub(crate) fn chart(timeline: &Timeline<'_>, series: &TimeSeries, axes: &Axes, size: (f64, f64)) -> Markup {
    let clip = format!("clip-{}", series.id);
    let [left, top, width, height] = axes.inside();
    let ticks = if size.1 < 150.0 { 3 } else { 5 };
    let bounds = series.values.iter().map(|v| v.map(|v| (v.low, v.high)));
    html! {
        svg viewBox=(view_box(size)) role="img" aria-label=(format!("{} over time", series.name)) data-series=(series.id)
            data-inside=(format!("{left:.1} {width:.1}")) data-range=(format!("{:.4} {:.4}", axes.x.range().0, axes.x.range().1)) {
            (axes.grid(if size.1 < 150.0 { "" } else { timeline.name }, "", (5, ticks)))
            clipPath id=(clip) { rect x=(left) y=(top) width=(width) height=(height) {} }
            g clip-path=(format!("url(#{clip})")) {
                (zero(axes))
                path class="true" d=(line(timeline, axes, series.truths.iter().copied())) {}
                path class="band" d=(area(timeline, axes, bounds)) {}
                path class="line" d=(line(timeline, axes, series.values.iter().map(|v| v.map(|v| v.value)))) {}
            }
            (unanswered(timeline, axes))
            (cursor(timeline, axes))
        }
    }
}

/// Axes over time with a linear ordinate.
pub(crate) fn axes(timeline: &Timeline<'_>, range: (f64, f64), size: (f64, f64)) -> Axes {
    Axes { x: time_scale(timeline, size), y: AxisScale::linear(range, (size.1 - MARGIN[3], MARGIN[2])) }
}

/// The time axis of a chart.
pub(crate) fn time_scale(timeline: &Timeline<'_>, size: (f64, f64)) -> AxisScale {
    AxisScale::linear(timeline.range, (MARGIN[0], size.0 - MARGIN[1]))
}

/// Room for estimates and truth, and for the bands as far as they leave the curve readable.
pub(crate) fn value_range(series: &TimeSeries) -> (f64, f64) {
    let values = series.values.iter().flatten().map(|v| v.value);
    let Some((lo, hi)) = extent(values.chain(series.truths.iter().flatten().copied())) else {
        return (-1.0, 1.0);
    };
    let halves: Vec<f64> = series.values.iter().flatten().map(|v| 0.5 * (v.high - v.low)).collect();
    let usual = quantile(&halves, 0.9).unwrap_or(0.0);
    let pad = 0.06 * (hi - lo) + (1.1 * usual).min((hi - lo).max(3.0 * usual));
    (lo - pad, hi + pad)
}

/// Room on both sides of zero for errors and the usual band.
pub(crate) fn error_range(series: &TimeSeries) -> (f64, f64) {
    let values = series.values.iter().flatten().map(|v: &Interval| v.value.abs());
    let largest = values.filter(|v| v.is_finite()).fold(1.15 * series.usual_band(), f64::max);
    (-1.1 * largest, 1.1 * largest)
}

/// A curve over time, which starts anew after each gap.
pub(crate) fn line(
    timeline: &Timeline<'_>,
    axes: &Axes,
    values: impl Iterator<Item = Option<f64>>,
) -> String {
    path(timeline.times.iter().zip(values).map(|(&t, v)| axes.at(t, v?)))
}

/// The area (low, high) around something, over time.
fn area(timeline: &Timeline<'_>, axes: &Axes, bounds: impl Iterator<Item = Option<(f64, f64)>>) -> String {
    let points = timeline.times.iter().zip(bounds).map(|(&t, bounds)| {
        let (low, high) = bounds?;
        Some((axes.x.at(t)?, axes.y.at(low)?, axes.y.at(high)?))
    });
    band(&points.collect::<Vec<_>>())
}

/// The line of zero, where it lies inside.
fn zero(axes: &Axes) -> Markup {
    let [left, _, width, _] = axes.inside();
    html! { @if let Some(y) = axes.y.at(0.0) { path class="zero" d=(format!("M{left:.1} {y:.1}h{width:.1}")) {} } }
}

/// The attribute of that name.
pub(crate) fn view_box((width, height): (f64, f64)) -> String {
    format!("0 0 {width} {height}")
}

/// Ticks on the lower edge where a frame asked for an answer and got none.
pub(crate) fn unanswered(timeline: &Timeline<'_>, axes: &Axes) -> Markup {
    let [_, top, _, height] = axes.inside();
    let tick = |&t: &f64| Some(format!("M{:.1} {:.1}v-7", axes.x.at(t)?, top + height));
    let ticks: String = timeline.unanswered.iter().filter_map(tick).collect();
    html! { @if !ticks.is_empty() { path class="missing" d=(ticks) {} } }
}

/// A line that follows the slider.
pub(crate) fn cursor(timeline: &Timeline<'_>, axes: &Axes) -> Markup {
    let [_, top, _, height] = axes.inside();
    let place = |&t: &f64| axes.x.at(t).map_or("-99".to_owned(), |x| format!("{x:.1}"));
    let at: Vec<String> = timeline.slider_times.iter().map(place).collect();
    html! {
        @if let Some(first) = at.first() {
            path class="cursor" transform=(format!("translate({first} 0)")) data-x=(at.join(" ")) d=(format!("M0 {top}v{height}")) {}
        }
    }
}
