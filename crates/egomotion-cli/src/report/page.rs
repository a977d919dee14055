//! The page: its sections in order, each with one plain sentence.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::pictures::{FramePictures, QUANTITIES, Quantity};
use super::{Report, charts, figures, impact, tables, trajectory};
use crate::chart::PAGE_STYLE;
use crate::chart::colour::Spread;
use crate::chart::number::{Unit, fixed, length, significant};
use crate::chart::plot::Scale;

/// Rules for the parts of this page.
const STYLE: &str = include_str!("style.css");
/// Moves the slider; without it the page shows its first pictures.
const SCRIPT: &str = include_str!("script.js");
/// Nothing is loaded from anywhere, whatever the texts of the input say.
const POLICY: &str =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// The whole page as one HTML document that loads nothing.
pub fn render(report: &Report<'_>) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                title { (report.title) }
                style { (PreEscaped(PAGE_STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (report.title) }
                    p { "How a stereo camera moved, and how soon it would have hit something, each with its uncertainty. From " b { (report.source) } "." }
                }
                main {
                    (figures::headline(report))
                    @let notes = notes(report);
                    @if !notes.is_empty() { ul class="notes" { @for note in &notes { li { (note) } } } }
                    div class="pair" { (path(report)) (impacts(report)) }
                    (pictures(report))
                    (motion(report))
                    (times(report))
                    (numbers(report))
                    (repeat(report))
                }
                footer { "Made by egomotion " (env!("CARGO_PKG_VERSION")) ". The numbers are in motion.csv and summary.json beside this page." }
                @if !report.pictures.is_empty() { script { (PreEscaped(SCRIPT)) } }
            }
        }
    };
    page.into_string()
}

fn notes(report: &Report<'_>) -> Vec<String> {
    let mut notes = report.notes.clone();
    let shown = report.shown().len();
    if shown < report.pictures.len() {
        notes.push(format!(
            "Pictures are shown of {shown} frames, evenly spaced, out of {}.",
            report.pictures.len()
        ));
    }
    notes
}

fn path(report: &Report<'_>) -> Markup {
    html! {
        section {
            h2 { "Path from above" }
            p { "Where the left camera went, seen from above: it looks up the page at the start, and a metre is the same length in both directions." }
            (legend(&[("line", "estimate"), ("true", "truth")][..if report.truth.is_some() { 2 } else { 1 }]))
            (trajectory::chart(report))
        }
    }
}

fn impacts(report: &Report<'_>) -> Markup {
    html! {
        section {
            h2 { "Time to impact of the nearest obstacle" }
            p { "Seconds until the first thing in the camera's way is reached if nothing changes its motion; it falls as an obstacle comes nearer." }
            @match impact::chart(report) {
                Some(chart) => {
                    (legend(&[("line", "time to impact (s)"), ("interval", "95 % interval; faded up to the edge: no upper end")]))
                    (chart)
                }
                None => p class="empty" { "Nothing in the way approached in this run." },
            }
            @if let Some(none) = impact::none(report) { p class="small" { (none) } }
        }
    }
}

fn motion(report: &Report<'_>) -> Markup {
    let truth = report.frames.iter().any(|row| row.truth.is_some());
    let gaps = report.frames.iter().any(|row| row.asks() && row.motion.is_none());
    let mut items = vec![("line", "estimate"), ("band", "±2σ")];
    items.extend(truth.then_some(("true", "truth")));
    items.extend(gaps.then_some(("missing", "no answer")));
    html! {
        section {
            h2 { "Motion from frame to frame: φ" }
            p {
                "φ is how the scene moves as the camera sees it, from one frame to the next: three shifts "
                b { "t" } " (X right, Y down, Z ahead) and three turns " b { "Ω" }
                " about these axes. The camera itself moves the opposite way. The true value lies in the band, ±2σ, 95 times out of 100."
                @if truth { " The strip below each chart shows how far off the estimate is, against the same band." }
                @if gaps { " After a frame without an answer the interval is longer, and so is φ." }
            }
            (legend(&items))
            (charts::phi(report))
        }
    }
}

fn times(report: &Report<'_>) -> Markup {
    html! {
        section {
            h2 { "Where the time goes" }
            p { "Milliseconds spent in each step, mean per frame; " b { (significant(report.frame_ms, 3)) " ms" } " in all." }
            (tables::stages(report))
        }
    }
}

fn numbers(report: &Report<'_>) -> Markup {
    html! {
        section {
            details {
                summary { h2 { "Every frame in numbers" } }
                p { "One row a frame: φ over the interval that ends there with its σ, and when the nearest obstacle would be reached." }
                (tables::frames(report))
            }
        }
    }
}

fn repeat(report: &Report<'_>) -> Markup {
    let rig = report.rig;
    html! {
        section {
            h2 { "Once more" }
            p { "The command that makes this page again, and all that was set." }
            pre { code { (report.command) } }
            p class="small" {
                "Rig: " (rig.width_px) "×" (rig.height_px) " pixels, focal length " (significant(rig.focal_px, 5))
                " px, baseline " (significant(rig.baseline_m * 1e3, 4)) " mm, principal point ("
                (fixed(rig.cx_px, 1)) ", " (fixed(rig.cy_px, 1)) ")."
            }
            details { summary { "Settings" } pre { code { (report.settings_toml) } } }
        }
    }
}

/// What lines and areas stand for.
fn legend(items: &[(&str, &str)]) -> Markup {
    html! {
        ul class="legend" {
            @for (class, text) in items {
                li {
                    svg viewBox="0 0 26 12" aria-hidden="true" {
                        @match *class {
                            "band" => path class="band" d="M0 1h26v10H0z" {},
                            "interval" => path class="interval" stroke-width="7" d="M7 0v12M19 0v12" {},
                            "missing" => path class="missing" d="M8 2v8M18 2v8" {},
                            "true" => path class="true" d="M0 6h26" {},
                            _ => path class="line" d="M0 6h26" {},
                        }
                    }
                    (text)
                }
            }
        }
    }
}

/// The slider through the frames with its pictures; nothing without pictures.
fn pictures(report: &Report<'_>) -> Markup {
    let shown = report.shown();
    let Some(size) = shown.first().map(|p| p.size()) else { return html! {} };
    let frames: Vec<String> = shown.iter().map(|p| p.frame.to_string()).collect();
    html! {
        section class="pictures" {
            h2 { "What the camera saw" }
            p {
                "Every pixel answers for itself. " b { "Disparity" } " is the shift between left and right image: large is near. "
                b { "Depth velocity VZ" } " is how much nearer or farther a point gets until the next frame: orange comes, blue goes, white stays; "
                b { "σ" } " is its standard deviation. " b { "Time to impact" } " is when the point reaches the camera's plane."
            }
            div class="slider" {
                button type="button" id="play" aria-label="play" { "▶" }
                input type="range" id="frame" min="0" max=(frames.len().saturating_sub(1)) value="0" data-frames=(frames.join(" ")) aria-label="frame";
                output for="frame" id="number" { "frame " (frames.first().map_or("", String::as_str)) }
            }
            div class="panels" {
                figure class="left" {
                    figcaption { b { "Left image" } }
                    (stack(&shown, "left image", size, |p| p.left_png()))
                }
                @for (i, quantity) in QUANTITIES.iter().enumerate() { (panel(&shown, i, quantity, size)) }
            }
            p class="small" { "Hatched: no answer there. The colours mean the same in all frames; values beyond the ends of a bar have the colour of the end." }
        }
    }
}

/// One quantity's pictures and its colour bar.
fn panel(shown: &[&FramePictures], i: usize, quantity: &Quantity, size: (usize, usize)) -> Markup {
    let range = quantity.spread.common(shown.iter().filter_map(|p| p.range(i)));
    let ends = [quantity.spread.value(range.0), quantity.spread.value(range.1)];
    let unit = match quantity.metres {
        true => length(ends[0].abs().max(ends[1].abs())),
        false => Unit { factor: 1.0, name: quantity.unit },
    };
    let ends = ends.map(|end| end * unit.factor);
    let scale = match quantity.spread {
        Spread::Logarithmic => Scale::log(ends.into(), (0.0, 100.0)),
        Spread::Linear | Spread::Symmetric => Scale::linear(ends.into(), (0.0, 100.0)),
    };
    let ticks = apart(scale.ticks(5).into_iter().filter_map(|(v, label)| Some((scale.at(v)?, label))));
    html! {
        figure {
            figcaption { b { (quantity.name) } " " span class="unit" { (unit.name) @if quantity.metres { " per interval" } } }
            (stack(shown, quantity.name, size, |p| p.map_png(i, range)))
            div class="bar-of-colours" style=(format!("background:{}", quantity.map.css_gradient())) {}
            div class="ticks" {
                @for (at, label) in ticks { span style=(format!("left:{:.1}%", at.clamp(0.0, 100.0))) { (label) } }
            }
        }
    }
}

/// Ticks that leave room for their labels, places in percent.
fn apart(ticks: impl Iterator<Item = (f64, String)>) -> Vec<(f64, String)> {
    let mut kept: Vec<(f64, String)> = Vec::new();
    for tick in ticks {
        if kept.last().is_none_or(|last| tick.0 - last.0 > 20.0) {
            kept.push(tick);
        }
    }
    kept
}

/// The pictures of one panel on top of each other, of which the script shows one.
fn stack(
    shown: &[&FramePictures],
    name: &str,
    (width, height): (usize, usize),
    png: impl Fn(&FramePictures) -> Option<Vec<u8>>,
) -> Markup {
    html! {
        div class="stack" {
            @for (k, pictures) in shown.iter().enumerate() {
                @if let Some(png) = png(pictures) {
                    img class=(if k == 0 { "on" } else { "" }) data-k=(k) width=(width) height=(height)
                        alt=(format!("{name}, frame {}", pictures.frame))
                        src=(format!("data:image/png;base64,{}", STANDARD.encode(png)));
                }
            }
        }
    }
}
