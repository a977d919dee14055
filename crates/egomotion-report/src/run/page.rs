//! The page: its sections in order, each with one plain sentence.

use maud::{Markup, PreEscaped, html};

use super::camera_path::CameraPath;
use super::report::Report;
use super::time_series::TimeSeries;
use super::timeline::Timeline;
use super::{
    body_velocity, charts, impact, observability, player, scene_motion, script_data, summary, tables, viewer,
    warnings,
};
use crate::chart::document::scripted_document;
use crate::chart::number::{fixed, significant};

/// Rules for the parts of this page.
pub(crate) const STYLE: &str = include_str!("page.css");
/// Moves the slider and names values; without it the page shows its first pictures.
const SCRIPT: &str = include_str!("page.js");

/// Width and height of the chart of heights, in SVG units, which are pixels on a phone.
const HEIGHT_CHART_SIZE: (f64, f64) = (400.0, 170.0);

/// The whole page as one HTML document that loads nothing.
pub fn render(report: &Report<'_>) -> String {
    let timeline = Timeline::of(report);
    let positions = report.slider_positions();
    let path = CameraPath::of(report);
    let body = body_velocity::velocity_series(&timeline, body_velocity::speed_unit(report.frames));
    let phi = scene_motion::series(&timeline);
    let impact = impact::series(&timeline);
    let kept = observability::series(&timeline);
    let height = path.height(report, &timeline);
    let errors: Vec<TimeSeries> = phi.iter().filter_map(TimeSeries::errors).collect();
    let named: Vec<&TimeSeries> =
        body.iter().chain(&phi).chain(&errors).chain([&impact, &kept, &height]).collect();
    let body = html! {
        header {
            p class="kicker" { "egomotion · " (report.source) }
            h1 { (report.title) }
            (summary::lede(report))
            (summary::headline_numbers(report, &path, &body))
            (warning_list(report))
        }
        main {
            (player::bar(report, &positions))
            (viewer::viewer(report, &positions))
            div class="pair" {
                (above(report, &path))
                div { (heights(report, &timeline, &height)) (impacts(report, &timeline, &impact)) }
            }
            (velocities(report, &timeline, &body))
            div class="pair" { (determined(report, &timeline, &kept)) (times(report)) }
            (scene_motion(report, &timeline, &phi))
            (numbers(report))
            (repeat(report))
        }
        footer { "Made by egomotion " (env!("CARGO_PKG_VERSION")) ". The numbers are in motion.csv and summary.json beside this page." }
        @if !positions.is_empty() {
            script type="application/json" id="data" { (PreEscaped(script_data::json(&timeline, &named))) }
            script { (PreEscaped(SCRIPT)) }
        }
    };
    scripted_document(&format!("{} – egomotion", report.title), STYLE, &body)
}

fn warning_list(report: &Report<'_>) -> Markup {
    let all = warnings::sentences(report);
    html! {
        @if all.is_empty() {
            @if let Some(well) = warnings::all_well(report) { p class="well" { (well) } }
        } @else {
            div class="notes" id="warnings" { p { b { "What to know before trusting it" } } ul { @for sentence in &all { li { (sentence) } } } }
        }
    }
}

fn above(report: &Report<'_>, path: &CameraPath<'_>) -> Markup {
    let mut items = vec![("line", "estimate"), ("band", "95 % ellipse")];
    items.extend(report.truth.is_some().then_some(("true", "truth")));
    html! {
        section id="path" {
            h2 { "The path from above" }
            p { "At the start the camera looks up the page. A metre is the same length in both directions." }
            (legend(&items))
            (path.chart(report))
        }
    }
}

fn heights(report: &Report<'_>, timeline: &Timeline<'_>, height: &TimeSeries) -> Markup {
    let axes = charts::axes(timeline, charts::value_range(height), HEIGHT_CHART_SIZE);
    html! {
        section id="height" {
            h2 { "Height above the start " span class="unit" { (height.unit) } }
            (legend(&standard(report)))
            (charts::chart(timeline, height, &axes, HEIGHT_CHART_SIZE))
        }
    }
}

/// The legend of a curve with its band.
fn standard(report: &Report<'_>) -> Vec<(&'static str, &'static str)> {
    let mut items = vec![("line", "estimate"), ("band", "95 % band")];
    items.extend(report.frames.iter().any(|row| row.truth.is_some()).then_some(("true", "truth")));
    let gaps = report.frames.iter().any(|row| row.asks() && row.motion.is_none());
    items.extend(gaps.then_some(("missing", "no answer")));
    items
}

fn impacts(report: &Report<'_>, timeline: &Timeline<'_>, series: &TimeSeries) -> Markup {
    let reasons = impact::reasons(report.frames);
    html! {
        section id="impact" {
            h2 { "Time to impact of the nearest obstacle " span class="unit" { "s" } }
            p { "Until the first thing in the vehicle's way is reached if nothing changes its motion." }
            @match impact::chart(timeline, series, &reasons) {
                Some(chart) => {
                    (legend(&[("line", "time to impact"), ("interval", "95 % interval; fainter: no upper end")]))
                    (chart)
                }
                None => p class="empty" { "Nothing in the way approached in this run." },
            }
            @if let Some(none) = impact::none(report, &reasons) { p class="small" { (none) } }
        }
    }
}

fn velocities(report: &Report<'_>, timeline: &Timeline<'_>, body: &[TimeSeries]) -> Markup {
    html! {
        section id="velocity" {
            h2 { "How the camera moved, per second" }
            p { "Its own velocity and turning rate, as a driver would name them. The shaded band holds the true value 95 times out of 100; where it cannot be seen it is thinner than the line." }
            (legend(&standard(report)))
            (body_velocity::charts(timeline, body))
        }
    }
}

fn determined(report: &Report<'_>, timeline: &Timeline<'_>, kept: &TimeSeries) -> Markup {
    html! {
        section id="observed" {
            h2 { "What could be known" }
            p { "Which of the six components of the motion were determined by what was seen, in how many of the answered intervals." }
            (observability::lanes(report, timeline))
            h3 { "Measurements " span class="unit" { (kept.unit) } }
            @if let Some(sentence) = observability::sentence(report) { p { (sentence) } }
            (legend(&[("line", "kept"), ("all", "all")]))
            (observability::measurements(timeline, kept))
        }
    }
}

fn times(report: &Report<'_>) -> Markup {
    let rate = 1e3 / report.frame_ms;
    html! {
        section id="times" {
            h2 { "Where the computer's time went" }
            p {
                b { (significant(report.frame_ms, 3)) " ms a frame" }
                @if rate.is_finite() { ", " (significant(rate, 2)) " frames per second" }
                ". Means per frame; reading and computing overlap, so the steps may add up to more."
            }
            (tables::stages(report))
        }
    }
}

fn scene_motion(report: &Report<'_>, timeline: &Timeline<'_>, phi: &[TimeSeries]) -> Markup {
    let truth = phi.iter().any(|series| series.truths.iter().any(Option::is_some));
    html! {
        section id="phi" {
            h2 { "φ, from frame to frame" }
            p {
                "The numbers of motion.csv: how the scene moves as the camera sees it, the opposite of the camera's own motion. Three shifts "
                b { "t" } " (X right, Y down, Z ahead) and three turns " b { "Ω" } " about these axes, over the interval that ends at each frame."
                @if truth { " The strip below each chart shows how far off the estimate is, against its own band." }
            }
            (legend(&standard(report)))
            (scene_motion::charts(timeline, phi))
        }
    }
}

fn numbers(report: &Report<'_>) -> Markup {
    html! {
        section id="numbers" {
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
        section id="repeat" {
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
                            other => path class=(other) d="M0 6h26" {},
                        }
                    }
                    (text)
                }
            }
        }
    }
}
