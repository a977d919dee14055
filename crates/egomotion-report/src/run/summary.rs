//! The run in a few sentences and numbers, for who has never seen one.

use egomotion::metrics::{relative_pose_error, travelled_m};
use maud::{Markup, html};
use nalgebra::Vector3;

use super::camera_path::CameraPath;
use super::report::{FrameRow, InputKind, Report};
use super::time_series::TimeSeries;
use super::{body_velocity, impact, warnings};
use crate::chart::number::{Unit, count, length, significant};

/// One number at the head of the page: its name, its value, and what else to know.
struct HeadlineNumber {
    name: &'static str,
    value: String,
    beside: Vec<String>,
}

/// The first paragraph: how far, how fast, where to.
pub(crate) fn lede(report: &Report<'_>) -> Markup {
    let answered = report.frames.iter().any(|row| row.motion.is_some());
    let (seen_from, one, many) = match report.input {
        InputKind::Stereo => ("a pair of cameras alone", "pair of images", "pairs of images"),
        InputKind::Depth => ("a depth camera alone", "image with depth", "images with depth"),
        InputKind::Tracks => ("points followed in a pair of cameras", "set of points", "sets of points"),
    };
    let what = format!(
        "{}, {} × {} pixels",
        count(report.frames.len(), one, many),
        report.rig.width_px,
        report.rig.height_px
    );
    let span = span_s(report).map_or(String::new(), |s| format!(" over {} seconds", significant(s, 3)));
    html! {
        p class="lede" {
            @if report.biased && answered {
                b { "These numbers are wrong: the chosen method does not hold on this recording." }
                " " a href="#warnings" { "Why" } ". By this method it would seem that "
            }
            @if answered {
                @if report.biased { "the camera " } @else { "The camera " } b { "travelled " (distance(report)) } span class="nobreak" { (span) }
                @if let Some(speed) = mean_speed(report) { ", " b { (speed) } " on average" }
                @if let Some(turn) = turned(report) { ", and " (turn) }
                "."
            } @else {
                "No motion could be estimated from this recording."
            }
        }
        p class="about" {
            "Seen from " (seen_from) " (" (what) "): how they moved, how near each pixel is and how fast it comes nearer, and when it would be hit – each with the range that holds the true value 95 times out of 100."
        }
    }
}

/// The numbers below it.
pub(crate) fn headline_numbers(report: &Report<'_>, path: &CameraPath<'_>, body: &[TimeSeries]) -> Markup {
    let numbers = [
        distance_number(report, path),
        speed_number(report, body),
        impact_number(report),
        truth_number(report),
    ];
    html! {
        dl class="figures" {
            @for number in numbers.into_iter().flatten() {
                div {
                    dt { (number.name) }
                    dd { (number.value) }
                    @for line in number.beside { dd class="beside" { (line) } }
                }
            }
        }
    }
}

fn span_s(report: &Report<'_>) -> Option<f64> {
    let (first, last) = report.frames.first().zip(report.frames.last())?;
    Some(last.time_s - first.time_s).filter(|s| s.is_finite() && *s > 0.0)
}

fn distance(report: &Report<'_>) -> String {
    let total = travelled_m(report.poses).last().copied().unwrap_or(f64::NAN);
    let unit = length(total);
    unit.show(total * unit.factor, 3)
}

/// A speed as people say it; from walking pace on in km/h too.
fn in_words(speed_m_s: f64, unit: Unit) -> String {
    let value = format!("{}\u{a0}{}/s", significant(speed_m_s * unit.factor, 3), unit.name);
    if speed_m_s > 2.0 { format!("{value} ({} km/h)", significant(3.6 * speed_m_s, 2)) } else { value }
}

/// Distance over time of the answered intervals.
fn mean_speed(report: &Report<'_>) -> Option<String> {
    let answered =
        report.frames.iter().filter_map(|row| Some((body_velocity::speed_m_s(row)?, row.interval_s()?)));
    let (way, time) = answered.fold((0.0, 0.0), |(way, time), (v, dt)| (way + v * dt, time + dt));
    (time > 0.0).then(|| in_words(way / time, body_velocity::speed_unit(report.frames)))
}

/// Where the camera faces at the end, against its start.
fn turned(report: &Report<'_>) -> Option<String> {
    let (first, last) = report.poses.first().zip(report.poses.last())?;
    let ahead = first.rotation.transpose() * last.rotation * Vector3::z();
    let degrees = ahead.x.atan2(ahead.z).to_degrees();
    if !degrees.is_finite() {
        return None;
    }
    Some(match degrees.abs() {
        d if d < 1.0 => "ended up facing as it started".into(),
        d => format!(
            "ended up turned {}° to the {}",
            significant(d, 2),
            if degrees > 0.0 { "right" } else { "left" }
        ),
    })
}

fn distance_number(report: &Report<'_>, path: &CameraPath<'_>) -> Option<HeadlineNumber> {
    let (first, last) = report.poses.first().zip(report.poses.last())?;
    let away = (last.translation - first.translation).norm();
    let unit = length(away);
    let mut beside = vec![format!("end to start: {}", unit.show(away * unit.factor, 3))];
    beside.push(match path.end_within_m() {
        Some(within) => {
            let unit = length(within);
            format!("end known to ±{} (95 %)", unit.show(within * unit.factor, 2))
        }
        None => "how sure the end is cannot be said".into(),
    });
    Some(HeadlineNumber { name: "Distance", value: distance(report), beside })
}

fn speed_number(report: &Report<'_>, body: &[TimeSeries]) -> Option<HeadlineNumber> {
    let speeds = || report.frames.iter().filter_map(body_velocity::speed_m_s);
    let (low, high) = crate::chart::axes::extent(speeds())?;
    let unit = length(high);
    let known =
        |k: usize| body.get(k).map(|s| (s.usual_band(), s.unit.clone())).filter(|(b, _)| b.is_finite());
    let mut beside = Vec::new();
    if let Some((band, unit)) = known(0) {
        beside.push(format!("forward speed known to ±{} {unit} in each frame (95 %)", significant(band, 2)));
    }
    if let Some((band, unit)) = known(3) {
        beside.push(format!("turning to ±{} {unit}", significant(band, 2)));
    }
    let [low, high] = [low, high].map(|v| significant(v * unit.factor, 3));
    let value = if low == high { low } else { format!("{low} … {high}") };
    Some(HeadlineNumber { name: "Speed", value: format!("{value} {}/s", unit.name), beside })
}

/// The shortest time to impact, or that there is none.
fn impact_number(report: &Report<'_>) -> Option<HeadlineNumber> {
    let name = "Nearest impact";
    let of = |row: &FrameRow| Some((row.impact()?, row.frame));
    let answered = report.frames.iter().filter(|row| row.motion.is_some()).count();
    match report.frames.iter().filter_map(of).min_by(|a, b| a.0.value.total_cmp(&b.0.value)) {
        Some((seconds, frame)) => {
            let between = match seconds.high.is_finite() {
                true => {
                    format!("{} … {} s (95 %)", significant(seconds.low, 3), significant(seconds.high, 3))
                }
                false => format!("not before {} s (95 %)", significant(seconds.low, 3)),
            };
            let beside = vec![between, format!("at frame {frame}, if nothing changed")];
            Some(HeadlineNumber { name, value: format!("{} s", significant(seconds.value, 2)), beside })
        }
        None if answered > 0 => {
            let reasons = impact::reasons(report.frames);
            let beside = reasons.iter().map(|(why, _)| why.to_string()).collect();
            Some(HeadlineNumber { name, value: "none".into(), beside })
        }
        None => None,
    }
}

/// Against the truth: how far off, and whether the stated uncertainty is true.
fn truth_number(report: &Report<'_>) -> Option<HeadlineNumber> {
    let (share, components) = warnings::coverage(report)?;
    let within = format!("{} %", significant(100.0 * share, 3));
    let band = format!("{within} of {components} true values lie in their 95 % band");
    let name = "Off the truth";
    let Some(error) = relative_pose_error(report.poses, report.truth?) else {
        return Some(HeadlineNumber { name, value: "–".into(), beside: vec![band] });
    };
    let unit = length(error.t_rmse_m);
    let value = unit.show(error.t_rmse_m * unit.factor, 2);
    let beside = vec![
        format!("and {}° from frame to frame (root mean square)", significant(error.r_rmse_deg, 2)),
        band,
    ];
    Some(HeadlineNumber { name, value, beside })
}
