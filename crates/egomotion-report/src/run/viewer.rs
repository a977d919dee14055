//! Image and maps of the slider's frame, with their colour bars.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};

use super::pictures::{FramePictures, QUANTITIES, Quantity};
use super::report::{InputKind, Report};
use super::slider::SliderPosition;
use super::{outlines, player};
use crate::chart::axes::AxisScale;
use crate::chart::colour::ColourScaling;
use crate::chart::number::significant;

/// The pictures, or why there are none.
pub(crate) fn viewer(report: &Report<'_>, positions: &[SliderPosition]) -> Markup {
    let pictures: Vec<(usize, &FramePictures)> = positions
        .iter()
        .enumerate()
        .filter_map(|(k, position)| Some((k, report.album.pictures().get(position.picture?)?)))
        .collect();
    let maps = pictures.iter().any(|(_, picture)| picture.has_maps());
    html! {
        section class="viewer" id="pictures" {
            h2 { "What the camera saw" @if maps { ", and what every pixel says" } }
            p {
                @if pictures.is_empty() { "There are no pictures: no two good frames could be compared. " }
                @if positions.len() > 1 { span class="onscreen" { "Move the slider, press the arrow keys or touch a chart: all marks and pictures follow. " } }
                @if report.input == InputKind::Tracks { "The run was given points that another program followed, and no images." }
                @else if report.sparse { "This run followed corners alone (" code { "--observe sparse" } "), which is fast but makes no maps of every pixel." }
            }
            @if maps {
                div class="switch" role="radiogroup" aria-label="The maps show" {
                    span { "The maps show" }
                    label { input type="radio" name="layer" id="show-value" checked; " the quantity" }
                    label { input type="radio" name="layer" id="show-sigma"; " its uncertainty σ" }
                }
            }
            @if let Some((_, first)) = pictures.first() {
                div class=(if maps { "panels" } else { "panels one" }) {
                    figure {
                        figcaption { b { "Left image" } " " span class="unit" { "framed: moves by itself; dashed: the nearest obstacle" } }
                        (stack(&pictures, "left image", first.size(), outlines::overlay(report, positions), |p| {
                            Some(("jpeg", p.left_jpeg().to_vec())).filter(|(_, jpeg)| !jpeg.is_empty())
                        }))
                        div class="words" tabindex="0" role="region" aria-label="what is outlined" { (outlines::words(report, positions)) }
                    }
                    @if maps { @for i in (0..QUANTITIES.len()).step_by(2) { (pair(report, &pictures, i, first.size())) } }
                }
            }
            @if maps {
                p class="small" {
                    "Hatched: no answer there. The colours mean the same in all frames; what lies beyond the ends of a bar has the colour of its end."
                }
            }
            @if let Some(shown) = player::shown(report, positions) { p class="small" { (shown) } }
        }
    }
}

/// What a quantity is, in one line.
fn meaning(i: usize) -> &'static str {
    match i {
        0 => "shift between left and right image; large is near",
        2 => "orange comes nearer, blue gets farther, white keeps its distance",
        _ => "until the pixel's point reaches the camera's plane; bright is soon",
    }
}

/// A quantity, and its σ on the same place.
fn pair(report: &Report<'_>, pictures: &[(usize, &FramePictures)], i: usize, size: (usize, usize)) -> Markup {
    html! {
        figure {
            @for (class, i) in [("value", i), ("sigma", i + 1)] {
                @if let Some(quantity) = QUANTITIES.get(i) {
                    div class=(class) { (panel(report, pictures, i, quantity, size)) }
                }
            }
        }
    }
}

/// One quantity's pictures and its colour bar.
fn panel(
    report: &Report<'_>,
    pictures: &[(usize, &FramePictures)],
    i: usize,
    quantity: &Quantity,
    size: (usize, usize),
) -> Markup {
    let range = quantity.scaling.common(pictures.iter().filter_map(|(_, p)| p.range(i)));
    // Most of a still scene moves alike: room beyond it shows what is faster.
    let range =
        if quantity.scaling == ColourScaling::Symmetric { (1.4 * range.0, 1.4 * range.1) } else { range };
    let ends = (quantity.scaling.value(range.0), quantity.scaling.value(range.1));
    let scale = match quantity.scaling {
        ColourScaling::Logarithmic => AxisScale::log(ends, (0.0, 100.0)),
        ColourScaling::Linear | ColourScaling::Symmetric => AxisScale::linear(ends, (0.0, 100.0)),
    };
    let ticks: Vec<(f64, f64, String)> =
        scale.ticks(8).into_iter().filter_map(|(v, label)| Some((v, scale.at(v)?, label))).collect();
    let ticks = apart(ticks);
    html! {
        figcaption { b { (quantity.name) } " " span class="unit" { (quantity.unit) } }
        (stack(pictures, quantity.name, size, html! {}, |p| Some(("png", p.map_png(i, range)?))))
        div class="bar-of-colours" style=(format!("background:{}", quantity.map.css_gradient())) {}
        div class="ticks" {
            @for (_, at, label) in &ticks { span style=(format!("left:{:.1}%", at.clamp(0.0, 100.0))) { (label) } }
            span class="last" { (quantity.unit) }
        }
        @if i == 0 {
            div class="ticks" {
                @for (shift, at, _) in &ticks {
                    @if let Some(depth) = report.rig.depth(report.rig.disparity_from_shift(*shift)) {
                        span style=(format!("left:{:.1}%", at.clamp(0.0, 100.0))) { (significant(depth, 2)) }
                    }
                }
                span class="last" { "m away" }
            }
        }
        @if i.is_multiple_of(2) { p class="small" { (meaning(i)) } } @else { p class="small" { "the standard deviation: dark is sure" } }
    }
}

/// Ticks that leave room for their labels, and at the right for the unit; places in percent.
fn apart(ticks: Vec<(f64, f64, String)>) -> Vec<(f64, f64, String)> {
    let mut kept: Vec<(f64, f64, String)> = Vec::new();
    for tick in ticks {
        if tick.1 < 84.0 && kept.last().is_none_or(|last| tick.1 - last.1 > 11.0) {
            kept.push(tick);
        }
    }
    kept
}

/// The pictures of one panel on top of each other, of which the script shows one.
fn stack(
    pictures: &[(usize, &FramePictures)],
    name: &str,
    (width, height): (usize, usize),
    over: Markup,
    content: impl Fn(&FramePictures) -> Option<(&'static str, Vec<u8>)>,
) -> Markup {
    html! {
        div class="stack" style=(format!("aspect-ratio:{width}/{height}")) {
            @for (k, picture) in pictures {
                @if let Some((kind, bytes)) = content(picture) {
                    img class=(if *k == 0 { "on" } else { "" }) data-k=(k) width=(width) height=(height)
                        alt=(format!("{name}, frame {}", picture.frame))
                        src=(format!("data:image/{kind};base64,{}", STANDARD.encode(bytes)));
                }
            }
            (over)
        }
    }
}
