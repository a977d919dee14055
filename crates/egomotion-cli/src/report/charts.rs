//! φ over time: six small charts with their ±2σ bands.

use egomotion::metrics::quantile;
use maud::{Markup, html};

use super::{FrameRow, Report};
use crate::chart::number::{DEGREES, Unit, length};
use crate::chart::plot::{Axes, MARGIN, Scale, band, extent, path};

/// Width and height of a small chart, in SVG units, which are pixels on a phone.
const SIZE: (f64, f64) = (340.0, 190.0);
/// The same of the chart of errors below it.
const ERROR_SIZE: (f64, f64) = (340.0, 100.0);

/// The components of φ and what a positive value means.
const COMPONENTS: [(&str, &str, &str); 6] = [
    ("t", "X", "positive: the scene shifts right"),
    ("t", "Y", "positive: the scene shifts down"),
    ("t", "Z", "negative: the scene comes nearer"),
    ("Ω", "X", "positive: the camera nods down"),
    ("Ω", "Y", "positive: the camera turns left"),
    ("Ω", "Z", "positive: the scene rolls clockwise"),
];

/// One component of every row, in the unit of its chart.
struct Series {
    times: Vec<f64>,
    time_name: &'static str,
    /// (value, σ).
    estimates: Vec<Option<(f64, f64)>>,
    truths: Vec<Option<f64>>,
}

impl Series {
    fn new(report: &Report<'_>, i: usize, unit: Unit) -> Self {
        let (times, time_name) = report.abscissa();
        let estimate = |row: &FrameRow| row.component(i).map(|(v, s)| (v * unit.factor, s * unit.factor));
        let truth = |row: &FrameRow| row.truth.map(|t| t.vector()[i] * unit.factor);
        Self {
            times,
            time_name,
            estimates: report.frames.iter().map(estimate).collect(),
            truths: report.frames.iter().map(truth).collect(),
        }
    }

    /// Estimate − truth ± σ.
    fn errors(&self) -> Vec<Option<(f64, f64)>> {
        let error = |(e, t): (&Option<(f64, f64)>, &Option<f64>)| e.zip(*t).map(|((v, s), t)| (v - t, s));
        self.estimates.iter().zip(&self.truths).map(error).collect()
    }

    fn line(&self, axes: &Axes, values: impl Iterator<Item = Option<f64>>) -> String {
        path(self.times.iter().zip(values).map(|(&t, v)| axes.at(t, v?)))
    }

    /// The area (low, high) around something, over time.
    fn area(&self, axes: &Axes, bounds: impl Iterator<Item = Option<(f64, f64)>>) -> String {
        let points = self.times.iter().zip(bounds).map(|(&t, bounds)| {
            let (low, high) = bounds?;
            Some((axes.x.at(t)?, axes.y.at(low)?, axes.y.at(high)?))
        });
        band(&points.collect::<Vec<_>>())
    }

    fn usual_sigma(&self) -> f64 {
        let sigmas: Vec<f64> = self.estimates.iter().flatten().map(|(_, s)| *s).collect();
        quantile(&sigmas, 0.5).unwrap_or(f64::NAN)
    }
}

/// The six charts.
pub fn phi(report: &Report<'_>) -> Markup {
    let translations = report.frames.iter().flat_map(|row| (0..3).filter_map(|i| row.component(i)));
    let metres = length(translations.map(|(v, _)| v.abs()).fold(0.0, f64::max));
    html! {
        div class="charts" {
            @for (i, (symbol, axis, sign)) in COMPONENTS.into_iter().enumerate() {
                @let unit = if i < 3 { metres } else { DEGREES };
                @let series = Series::new(report, i, unit);
                figure {
                    figcaption {
                        b { (symbol) sub { (axis) } } " " span class="unit" { (unit.name) " per interval" }
                        span class="sign" { (sign) "; 2σ is about " (unit.show(2.0 * series.usual_sigma(), 2)) }
                    }
                    (over_time(report, &series, i))
                    @if series.errors().iter().any(Option::is_some) { (errors(report, &series, i)) }
                }
            }
        }
    }
}

/// One component over time.
fn over_time(report: &Report<'_>, series: &Series, i: usize) -> Markup {
    let y = Scale::linear(value_range(&series.estimates, &series.truths), vertical(SIZE));
    let axes = time_axes(&series.times, SIZE, y);
    let clip = format!("clip-phi-{i}");
    let (symbol, axis, _) = COMPONENTS[i];
    let bounds = series.estimates.iter().map(|e| e.map(|(v, s)| (v - 2.0 * s, v + 2.0 * s)));
    html! {
        svg viewBox=(view_box(SIZE)) role="img" aria-label=(format!("{symbol}{axis} over time")) {
            (axes.grid(series.time_name, "", (5, 5)))
            (clip_path(&clip, &axes))
            g clip-path=(format!("url(#{clip})")) {
                (zero(&axes))
                path class="true" d=(series.line(&axes, series.truths.iter().copied())) {}
                path class="band" d=(series.area(&axes, bounds)) {}
                path class="line" d=(series.line(&axes, series.estimates.iter().map(|e| e.map(|(v, _)| v)))) {}
            }
            (unanswered(report, &series.times, &axes))
            (cursor(report, &series.times, &axes))
        }
    }
}

/// The error of one component over time, against its own ±2σ.
fn errors(report: &Report<'_>, series: &Series, i: usize) -> Markup {
    let errors = series.errors();
    let largest = errors.iter().flatten().map(|(e, _)| e.abs()).fold(2.3 * series.usual_sigma(), f64::max);
    let y = Scale::linear((-1.1 * largest, 1.1 * largest), (ERROR_SIZE.1 - 8.0, 18.0));
    let axes = time_axes(&series.times, ERROR_SIZE, y);
    let clip = format!("clip-error-{i}");
    let (symbol, axis, _) = COMPONENTS[i];
    let bounds = errors.iter().map(|e| e.map(|(_, s)| (-2.0 * s, 2.0 * s)));
    html! {
        svg viewBox=(view_box(ERROR_SIZE)) role="img" aria-label=(format!("error of {symbol}{axis}")) {
            (axes.grid("", "estimate − truth", (0, 3)))
            (clip_path(&clip, &axes))
            g clip-path=(format!("url(#{clip})")) {
                (zero(&axes))
                path class="band" d=(series.area(&axes, bounds)) {}
                path class="line" d=(series.line(&axes, errors.iter().map(|e| e.map(|(v, _)| v)))) {}
            }
            (cursor(report, &series.times, &axes))
        }
    }
}

/// The line of zero, where it lies inside.
fn zero(axes: &Axes) -> Markup {
    let [left, _, width, _] = axes.inside();
    html! { @if let Some(y) = axes.y.at(0.0) { path class="zero" d=(format!("M{left:.1} {y:.1}h{width:.1}")) {} } }
}

/// Room for estimates and truth, and for the bands as far as they leave the curve readable.
fn value_range(estimates: &[Option<(f64, f64)>], truths: &[Option<f64>]) -> (f64, f64) {
    let values = estimates.iter().flatten().map(|(v, _)| *v);
    let Some((lo, hi)) = extent(values.chain(truths.iter().flatten().copied())) else { return (-1.0, 1.0) };
    let sigmas: Vec<f64> = estimates.iter().flatten().map(|(_, s)| *s).collect();
    let usual = quantile(&sigmas, 0.9).unwrap_or(0.0);
    let pad = 0.06 * (hi - lo) + (2.2 * usual).min((hi - lo).max(6.0 * usual));
    (lo - pad, hi + pad)
}

/// Top and bottom of the inside of a chart, from low to high values.
pub fn vertical(size: (f64, f64)) -> (f64, f64) {
    (size.1 - MARGIN[3], MARGIN[2])
}

/// Axes over time, with half a step of room at both ends.
pub fn time_axes(times: &[f64], size: (f64, f64), y: Scale) -> Axes {
    let (lo, hi) = extent(times.iter().copied()).unwrap_or((0.0, 1.0));
    let room = if hi > lo { 0.5 * (hi - lo) / times.len().max(2) as f64 } else { 0.5 };
    Axes { x: Scale::linear((lo - room, hi + room), (MARGIN[0], size.0 - MARGIN[1])), y }
}

/// The attribute of that name.
pub fn view_box((width, height): (f64, f64)) -> String {
    format!("0 0 {width} {height}")
}

/// A clip path of the inside of a chart.
pub fn clip_path(id: &str, axes: &Axes) -> Markup {
    let [x, y, width, height] = axes.inside();
    html! { clipPath id=(id) { rect x=(x) y=(y) width=(width) height=(height) {} } }
}

/// Ticks on the lower edge where a frame asked for an answer and got none.
pub fn unanswered(report: &Report<'_>, times: &[f64], axes: &Axes) -> Markup {
    let [_, top, _, height] = axes.inside();
    let without = report.frames.iter().zip(times).filter(|(row, _)| row.asks() && row.motion.is_none());
    let ticks: String =
        without.filter_map(|(_, &t)| Some(format!("M{:.1} {:.1}v-7", axes.x.at(t)?, top + height))).collect();
    html! { @if !ticks.is_empty() { path class="missing" d=(ticks) {} } }
}

/// A line that follows the slider through the pictures.
pub fn cursor(report: &Report<'_>, times: &[f64], axes: &Axes) -> Markup {
    let [_, top, _, height] = axes.inside();
    let at = report.shown_rows().into_iter().map(|row| {
        let x = row.and_then(|row| axes.x.at(*times.get(row)?));
        x.map_or("translate(-99 0)".to_owned(), |x| format!("translate({x:.1} 0)"))
    });
    let at: Vec<String> = at.collect();
    html! {
        @if let Some(first) = at.first() {
            path class="cursor" transform=(first) data-at=(at.join(";")) d=(format!("M0 {top}v{height}")) {}
        }
    }
}
