//! What to know before trusting a run, in plain words.

use super::observability;
use super::report::Report;
use crate::chart::number::{count, significant};

/// Most frames that are named in a sentence, so that it stays one.
const MAX_NAMED: usize = 8;

/// Share of the true values in their 95 % bands below which the bands are doubted. A larger value warns of short runs
/// whose share is low by chance; a smaller one overlooks bands that are too narrow.
const DOUBTFUL_COVERAGE: f64 = 0.85;

/// One sentence for each kind of warning; none where all went well.
pub(crate) fn sentences(report: &Report<'_>) -> Vec<String> {
    let mut all = Vec::new();
    if !report.complete {
        all.push("The run was stopped before its end: this page covers the frames that were done.".into());
    }
    all.extend(unanswered(report));
    all.extend(partial(report));
    all.extend(report.notes.iter().cloned());
    if let Some((share, components)) = coverage(report).filter(|(share, _)| *share < DOUBTFUL_COVERAGE) {
        all.push(format!(
            "Of {components} true values only {} % lie in their 95 % band: the truth is less exact than the estimate, or the stated uncertainty is too small.",
            significant(100.0 * share, 2)
        ));
    }
    all
}

/// Frames without an answer, by status.
fn unanswered(report: &Report<'_>) -> Vec<String> {
    let mut by_status: Vec<(&str, Vec<usize>)> = Vec::new();
    for row in report.frames.iter().filter(|row| row.asks() && row.motion.is_none()) {
        match by_status.iter_mut().find(|(status, _)| *status == row.status) {
            Some((_, frames)) => frames.push(row.frame),
            None => by_status.push((&row.status, vec![row.frame])),
        }
    }
    let sentence = |(status, frames): (&str, Vec<usize>)| {
        let named: Vec<String> = frames.iter().take(MAX_NAMED).map(usize::to_string).collect();
        let more = if frames.len() > MAX_NAMED { ", …" } else { "" };
        let noun = if frames.len() == 1 { "frame" } else { "frames" };
        format!(
            "{} gave no motion: {} ({noun} {}{more}).",
            count(frames.len(), "interval", "intervals"),
            in_words(status),
            named.join(", ")
        )
    };
    by_status.into_iter().map(sentence).collect()
}

/// What a status means.
fn in_words(status: &str) -> &str {
    match status {
        "bad_image" => "an image is missing, damaged or without contrast",
        "missing_right" => "the right image is missing",
        "bad_time" => "the time stamp does not increase",
        "few_rows" => "too few points could be measured",
        "unobservable" => "what was seen determines no direction of motion",
        "not_finite" => "the equations overflowed",
        "not_converged" => "the estimate did not settle",
        other => other,
    }
}

fn partial(report: &Report<'_>) -> Option<String> {
    let free = observability::undetermined(report.frames);
    let total: usize = free.iter().map(|(_, count)| count).sum();
    let (words, most) = free.first()?;
    let mostly = if *most == total { "" } else { "mostly: " };
    Some(format!(
        "In {} part of the motion cannot be known from what was seen ({mostly}{words}); it is left open rather than guessed.",
        count(total, "interval", "intervals")
    ))
}

/// The share of components whose truth lies in the 95 % band, and their number; `None` without truth.
pub(crate) fn coverage(report: &Report<'_>) -> Option<(f64, usize)> {
    let judged = report.frames.iter().flat_map(|row| {
        let truth = row.truth.map(|t| t.vector());
        (0..6).filter_map(move |i| Some((row.component(i)?, truth?[i])))
    });
    let (mut within, mut all) = (0_usize, 0_usize);
    for ((value, sigma), truth) in judged.filter(|(_, truth)| truth.is_finite()) {
        all += 1;
        within += usize::from((value - truth).abs() <= super::interval::BAND_HALF_WIDTH_SIGMA * sigma);
    }
    (all > 0).then(|| (within as f64 / all as f64, all))
}

/// Where nothing went wrong, it says so.
pub(crate) fn all_well(report: &Report<'_>) -> Option<String> {
    let asked = report.frames.iter().filter(|row| row.asks()).count();
    let which = match asked {
        0 => return None,
        1 => "the one interval".to_owned(),
        n => format!("every one of the {n} intervals"),
    };
    Some(format!("Nothing went wrong: all six components of the motion were determined in {which}."))
}
