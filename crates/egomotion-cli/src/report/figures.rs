//! The headline figures.

use egomotion::metrics::{relative_pose_error, travelled_m};
use maud::{Markup, html};

use super::{FrameRow, Report};
use crate::chart::number::{count, length, significant};

/// One figure: what it is, its value, and what else to know.
struct Figure {
    name: &'static str,
    value: String,
    beside: String,
}

/// The headline figures of a run.
pub fn headline(report: &Report<'_>) -> Markup {
    let figures = [
        Some(frames(report)),
        travelled(report),
        Some(answered(report)),
        soonest(report),
        speed(report),
        translation_error(report),
        rotation_error(report),
        within_two_sigma(report),
    ];
    html! {
        dl class="figures" {
            @for figure in figures.into_iter().flatten() {
                div {
                    dt { (figure.name) }
                    dd { (figure.value) }
                    dd class="beside" { (figure.beside) }
                }
            }
        }
    }
}

fn frames(report: &Report<'_>) -> Figure {
    let ends = report.frames.first().zip(report.frames.last());
    let span_s = ends.map_or(0.0, |(first, last)| last.time_s - first.time_s);
    let beside = if span_s > 0.0 { format!("over {} s", significant(span_s, 3)) } else { String::new() };
    Figure { name: "Frames", value: report.poses.len().max(report.frames.len()).to_string(), beside }
}

fn travelled(report: &Report<'_>) -> Option<Figure> {
    let total = *travelled_m(report.poses).last()?;
    let unit = length(total);
    let value = unit.show(total * unit.factor, 3);
    let (first, last) = report.poses.first().zip(report.poses.last())?;
    let away = (last.translation - first.translation).norm();
    let beside = format!("ends {} from its start", unit.show(away * unit.factor, 3));
    Some(Figure { name: "Distance travelled", value, beside })
}

fn answered(report: &Report<'_>) -> Figure {
    let asked = report.frames.iter().filter(|row| row.asks()).count();
    let answers = report.frames.iter().filter(|row| row.asks() && row.motion.is_some()).count();
    let partial = report.frames.iter().filter_map(|row| row.motion).filter(|m| !m.is_complete()).count();
    let beside = match (asked - answers, partial) {
        (0, 0) => "every interval has its motion".into(),
        (0, n) => format!("{n} of them in part"),
        (n, 0) => format!("{n} without an answer"),
        (n, p) => format!("{n} without an answer, {p} in part"),
    };
    Figure { name: "Answered", value: format!("{answers} of {asked}"), beside }
}

/// The shortest time to impact.
fn soonest(report: &Report<'_>) -> Option<Figure> {
    let of =
        |row: &FrameRow| Some((row.impact.ok()?.seconds()?, row.impact.ok()?.interval95_s()?, row.frame));
    let times = report.frames.iter().filter_map(of).filter(|(s, ..)| s.is_finite());
    let (seconds, (low, high), frame) = times.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let high = if high.is_finite() { significant(high, 3) } else { "∞".into() };
    let beside = format!("at frame {frame}; 95 %: {} … {high} s", significant(low, 3));
    Some(Figure { name: "Soonest impact", value: format!("{} s", significant(seconds, 3)), beside })
}

fn speed(report: &Report<'_>) -> Option<Figure> {
    let ms = report.frame_ms;
    (ms.is_finite() && ms > 0.0).then(|| Figure {
        name: "Time per frame",
        value: format!("{} ms", significant(ms, 3)),
        beside: format!("{} frames per second", significant(1e3 / ms, 2)),
    })
}

fn translation_error(report: &Report<'_>) -> Option<Figure> {
    let error = relative_pose_error(report.poses, report.truth?)?;
    let unit = length(error.t_rmse_m);
    let show = |v: f64| significant(v * unit.factor, 2);
    Some(Figure {
        name: "Translation error",
        value: unit.show(error.t_rmse_m * unit.factor, 2),
        beside: format!(
            "frame to frame, root mean square; median {}, largest {}",
            show(error.t_median_m),
            show(error.t_max_m)
        ),
    })
}

fn rotation_error(report: &Report<'_>) -> Option<Figure> {
    let error = relative_pose_error(report.poses, report.truth?)?;
    let show = |v: f64| significant(v, 2);
    Some(Figure {
        name: "Rotation error",
        value: format!("{}°", show(error.r_rmse_deg)),
        beside: format!(
            "frame to frame, root mean square; median {}°, largest {}°",
            show(error.r_median_deg),
            show(error.r_max_deg)
        ),
    })
}

/// Whether the stated uncertainty is true: 95 % of all components should lie within 2σ of the truth.
fn within_two_sigma(report: &Report<'_>) -> Option<Figure> {
    let judged = report.frames.iter().flat_map(|row| {
        let truth = row.truth.map(|t| t.vector());
        (0..6).filter_map(move |i| Some((row.component(i)?, truth?[i])))
    });
    let (mut within, mut all) = (0, 0);
    for ((value, sigma), truth) in judged.filter(|(_, truth)| truth.is_finite()) {
        all += 1;
        within += usize::from((value - truth).abs() <= 2.0 * sigma);
    }
    (all > 0).then(|| Figure {
        name: "Truth within ±2σ",
        value: format!("{} %", significant(100.0 * f64::from(within as u32) / f64::from(all), 3)),
        beside: format!("{within} of {}; 95 % is expected", count(all as usize, "component", "components")),
    })
}
