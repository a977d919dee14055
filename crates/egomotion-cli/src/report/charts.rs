//! φ over time: six small charts with their ±2σ bands.

use maud::{Markup, html};

use super::Report;
use super::number::{DEGREES, Unit, length};
use super::plot::{Axes, MARGIN, Scale, band, extent, path};

/// Width and height of a small chart, in SVG units, which are pixels on a phone.
const SIZE: (f64, f64) = (340.0, 190.0);

/// The components of φ and what a positive value means.
const COMPONENTS: [(&str, &str, &str); 6] = [
    ("t", "X", "positive: the scene shifts right"),
    ("t", "Y", "positive: the scene shifts down"),
    ("t", "Z", "negative: the scene comes nearer"),
    ("Ω", "X", "positive: the camera nods down"),
    ("Ω", "Y", "positive: the camera turns left"),
    ("Ω", "Z", "positive: the scene rolls clockwise"),
];

/// The six charts.
pub fn phi(report: &Report<'_>) -> Markup {
    let translations = report.frames.iter().flat_map(|row| (0..3).filter_map(|i| row.component(i)));
    let largest = translations.map(|(v, _)| v.abs()).fold(0.0, f64::max);
    let metres = length(largest);
    html! {
        div class="charts" {
            @for (i, (symbol, axis, sign)) in COMPONENTS.into_iter().enumerate() {
                @let unit = if i < 3 { metres } else { DEGREES };
                figure {
                    figcaption {
                        b { (symbol) sub { (axis) } } " " span class="unit" { (unit.name) " per interval" }
                        span class="sign" { (sign) }
                    }
                    (component(report, i, unit, &format!("{symbol}{axis} over time")))
                }
            }
        }
    }
}

/// One component over time.
fn component(report: &Report<'_>, i: usize, unit: Unit, label: &str) -> Markup {
    let (times, x_name) = report.abscissa();
    let estimates: Vec<Option<(f64, f64)>> = report
        .frames
        .iter()
        .map(|row| row.component(i).map(|(v, s)| (v * unit.factor, s * unit.factor)))
        .collect();
    let truths: Vec<Option<f64>> =
        report.frames.iter().map(|row| row.truth.map(|t| t.vector()[i] * unit.factor)).collect();
    let axes = time_axes(&times, SIZE, Scale::linear(value_range(&estimates, &truths), vertical(SIZE)));

    let line = |values: &mut dyn Iterator<Item = Option<f64>>| {
        path(times.iter().zip(values).map(|(&t, v)| axes.at(t, v?)))
    };
    let bounds: Vec<_> = times
        .iter()
        .zip(&estimates)
        .map(|(&t, e)| {
            let (value, sigma) = (*e)?;
            Some((axes.x.at(t)?, axes.y.at(value - 2.0 * sigma)?, axes.y.at(value + 2.0 * sigma)?))
        })
        .collect();
    let clip = format!("clip-phi-{i}");
    html! {
        svg viewBox=(view_box(SIZE)) role="img" aria-label=(label) {
            (axes.grid(x_name, "", (5, 4)))
            (clip_path(&clip, &axes))
            g clip-path=(format!("url(#{clip})")) {
                @if let Some(zero) = axes.y.at(0.0) {
                    path class="zero" d=(format!("M{:.1} {zero:.1}h{:.1}", axes.inside()[0], axes.inside()[2])) {}
                }
                path class="band" d=(band(&bounds)) {}
                path class="true" d=(line(&mut truths.iter().copied())) {}
                path class="line" d=(line(&mut estimates.iter().map(|e| e.map(|(v, _)| v)))) {}
            }
            (unanswered(report, &times, &axes))
            (cursor(report, &times, &axes))
        }
    }
}

/// Room for estimates and truth, and for the bands as far as they leave the curve readable.
fn value_range(estimates: &[Option<(f64, f64)>], truths: &[Option<f64>]) -> (f64, f64) {
    let values = estimates.iter().flatten().map(|(v, _)| *v);
    let Some((lo, hi)) = extent(values.chain(truths.iter().flatten().copied())) else { return (-1.0, 1.0) };
    let sigmas: Vec<f64> = estimates.iter().flatten().map(|(_, s)| *s).collect();
    let usual = egomotion::metrics::quantile(&sigmas, 0.9).unwrap_or(0.0);
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
    let ticks: String = without
        .filter_map(|(_, &t)| Some(format!("M{:.1} {:.1}v-7", axes.x.at(t)?, top + height)))
        .collect();
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
