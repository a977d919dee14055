//! A recording: Tables 3 to 7 and Figures 11 to 14 in the paper's form, and its answers from frame to frame.

use std::collections::BTreeSet;

use super::figures::{self, Typical};
use super::speed::{SpeedAxis, SpeedPlace};
use super::tables::{self, DepthVelocityEntry, Heading, MEDIANS, MotionEntry};
use super::{Example, RealResults};
use crate::real::contender::{ImageContender, ImageEstimator};
use crate::real::quantity::Quantity;
use crate::real::record::RealRecord;
use crate::synthetic::approach_name;
use crate::{Axis, Content, Figure, Line, Panel, Series, Table};
use egomotion::metrics::quantile;
use egomotion::pipeline::{Approach, Method};

/// Share of the image motion that the turn makes, no unit: frames above it turn, the others translate or do both.
const TURNING_SHARE: f64 = 0.5;
/// What follows a recording's name where its turning frames stand for themselves.
const TURNING: &str = ", turning";
/// Points along a line of Figures 12 to 14: more would each rest on few frames.
const MOST_GROUPS: usize = 6;
/// Frames of a point of Figures 12 to 14: fewer would say little of their spread.
const LEAST_FRAMES: usize = 5;
/// What the methods get, at the end of the captions of figures.
const INPUT: &str = "The recording's own images with their noise; disparity matched in them and rounded to steps (1/16 px unless \
     set otherwise), flow matched.";

/// The same records, in which the frames that turn are a sequence of their own, the last one.
pub(super) fn by_path(records: &[RealRecord]) -> Vec<RealRecord> {
    let turns =
        |record: &&RealRecord| record.quantity == Quantity::TurnShare && record.estimate > TURNING_SHARE;
    let frames: BTreeSet<i64> = records.iter().filter(turns).map(|record| record.pose).collect();
    let (turning, others): (Vec<&RealRecord>, Vec<&RealRecord>) =
        records.iter().partition(|record| frames.contains(&record.pose));
    let named = turning
        .into_iter()
        .map(|record| RealRecord { sequence: format!("{}{TURNING}", record.sequence), ..record.clone() });
    others.into_iter().cloned().chain(named).collect()
}

/// How fast a sequence is: its median |tZ| in mm per frame, or |ΩY| in degrees per frame of its turning frames.
pub(super) fn speed(results: &RealResults<'_>, sequence: &str) -> Option<f64> {
    let moving = if sequence.ends_with(TURNING) { Quantity::Wy } else { Quantity::Tz };
    median_speed(&speeds(results, moving, |record| record.sequence == sequence))
}

/// The speed of each frame in the size of a component of φ: the true one, or what maximum likelihood finds.
fn speeds(
    results: &RealResults<'_>,
    moving: Quantity,
    chosen: impl Fn(&RealRecord) -> bool,
) -> Vec<(f64, i64)> {
    let of_best = results.records.iter().filter(|record| {
        record.contender == Some(ImageContender::BEST) && record.quantity == moving && chosen(record)
    });
    of_best.map(|record| (record.truth.unwrap_or(record.estimate).abs(), record.pose)).collect()
}

fn median_speed(speeds: &[(f64, i64)]) -> Option<f64> {
    quantile(&speeds.iter().map(|(speed, _)| *speed).collect::<Vec<_>>(), 0.5)
}

/// What was recorded, then Tables 3 to 7.
pub(super) fn tables(name: &str, results: &RealResults<'_>) -> Vec<Table> {
    let (diff, disc) = (Approach::Differential, Approach::Discrete);
    let turning = |sequence: &str| sequence.ends_with(TURNING);
    vec![
        overview(name, results),
        vz(results, "table-03", "Table 3. Estimation of VZ: differential approach", diff),
        phi(results, ("table-04", "Table 4. Estimation of φ, turning: differential approach"), diff, turning),
        phi(
            results,
            ("table-05", "Table 5. Estimation of φ, translating and mixed: differential approach"),
            diff,
            |sequence| !turning(sequence),
        ),
        vz(results, "table-06", "Table 6. Estimation of VZ: discrete approach", disc),
        phi(results, ("table-07", "Table 7. Estimation of φ: discrete approach"), disc, |_| true),
    ]
}

fn overview(name: &str, results: &RealResults<'_>) -> Table {
    let truth = if results.have_truth() {
        "Errors are against its true poses, which have errors of their own."
    } else {
        "It has no true poses: tables hold estimates without errors, and Figures 12 to 14, which plot errors, are not there."
    };
    let caption = format!(
        "Three frames at a time, t−1, t and t+1. A frame is turning where the turn moves the image more than the \
         translation does; the paper's Table 4 is for those, its Table 5 for all others. {truth}"
    );
    let mut table = Table::new(
        "recording",
        &format!("What was recorded: {name}"),
        &caption,
        &[
            ("sequence", "frames"),
            ("n", "number"),
            ("with_truth", "with true poses"),
            ("speed", "|tZ|, median (mm)"),
            ("turn", "|ΩY|, median (°)"),
            ("turn_share", "share of the turn"),
        ],
    );
    for sequence in results.sequences() {
        let frames = |chosen: &dyn Fn(&RealRecord) -> bool| {
            let of = results.records.iter().filter(|record| record.sequence == sequence && chosen(record));
            of.map(|record| record.pose).collect::<BTreeSet<i64>>().len()
        };
        let median = |moving| median_speed(&speeds(results, moving, |record| record.sequence == sequence));
        let share = results.get(sequence, None, Quantity::TurnShare).map(|found| found.median);
        table.rows.push(vec![
            sequence.into(),
            frames(&|_| true).into(),
            frames(&|record| record.truth.is_some()).into(),
            median(Quantity::Tz).into(),
            median(Quantity::Wy).into(),
            share.into(),
        ]);
    }
    table
}

/// Table 3 or 6.
fn vz(results: &RealResults<'_>, id: &str, title: &str, approach: Approach) -> Table {
    let entry = |label| {
        let sequence: &str = label;
        DepthVelocityEntry {
            label: sequence,
            sequence: sequence.to_owned(),
            constant: !sequence.ends_with(TURNING),
            paper: None,
            sources: &[("here, anywhere", Quantity::VzStill)],
        }
    };
    let entries: Vec<_> = results.sequences().into_iter().map(entry).collect();
    let caption = format!(
        "−VZ in mm per frame; ERM is signed, in frames that turn absolute. True is what the true φ does to a still scene of \
         the measured depth, so that the noise of depth and everything that moves by itself count as errors. Every pixel counts \
         where something was measured. {MEDIANS}"
    );
    tables::vz(results, Heading { id, title, caption: &caption }, approach, &entries)
}

/// Table 4, 5 or 7.
fn phi(
    results: &RealResults<'_>,
    (id, title): (&str, &str),
    approach: Approach,
    chosen: impl Fn(&str) -> bool,
) -> Table {
    let exact = |sequence: &str| {
        let contender = tables::contenders(approach).into_iter().next();
        Quantity::PHI.map(|quantity| results.get(sequence, contender, quantity)?.truth)
    };
    let entry = |sequence| MotionEntry {
        label: sequence,
        sequence: sequence.to_owned(),
        above: vec![("true, mean", exact(sequence))]
            .into_iter()
            .filter(|(_, phi)| phi[0].is_some())
            .collect(),
    };
    let entries: Vec<_> =
        results.sequences().into_iter().filter(|sequence| chosen(sequence)).map(entry).collect();
    let none = if entries.is_empty() { " The recording has no such frame." } else { "" };
    let caption = format!(
        "mm and degrees per frame, of the left camera, {} approach. Mean ± standard deviation over the frames (median), in which \
         the motion itself changes.{none}",
        approach_name(approach)
    );
    tables::phi(results, Heading { id, title, caption: &caption }, approach, &entries)
}

/// Figures 11 to 14, of which the last three need a truth, and the answers from frame to frame.
pub(super) fn figures(name: &str, example: Option<Example<'_>>, results: &RealResults<'_>) -> Vec<Figure> {
    let about = format!(
        "A frame of {name}, rectified, and its computed disparity in steps (1/16 px unless set otherwise); blank where nothing \
         can be matched."
    );
    let mut all: Vec<Figure> = example.map(|example| figures::images(example, &about)).into_iter().collect();
    if results.have_truth() {
        all.extend(error_figures(name, results));
    }
    all.push(from_frame_to_frame(name, results));
    all
}

fn error_figures(name: &str, results: &RealResults<'_>) -> Vec<Figure> {
    let ahead = speed_axis(results, Quantity::Tz, ("against the speed ahead", "|tZ| (mm per frame)"));
    let turning = speed_axis(results, Quantity::Wy, ("against the turn", "|ΩY| (° per frame)"));
    let grouped = format!(
        "A point is a group of at least {LEAST_FRAMES} frames of alike speed, at the median speed. {INPUT}"
    );
    let mut all = vec![Figure {
        id: "figure-12".to_owned(),
        title: format!("Figure 12. Error of VZ against speed: {name}"),
        caption: format!(
            "Every pixel where something was measured, against a still scene under the true φ; all frames, against the speed \
             ahead and the turn; means over the frames of a point. {} {grouped}",
            figures::VZ_CAPTION
        ),
        columns: 2,
        panels: figures::vz(results, [&ahead, &turning], None),
    }];
    let motions = [
        ("figure-13", "Figure 13. Errors of φ against speed ahead", &ahead),
        ("figure-14", "Figure 14. Errors of φ against turn", &turning),
    ];
    for (id, title, axis) in motions {
        let figure = |id: String, title: String, errors: &str, typical| Figure {
            id,
            title: format!("{title}: {name}"),
            caption: format!(
                "{errors} against the true poses, all frames. {} {grouped}",
                figures::PHI_CAPTION
            ),
            columns: 3,
            panels: figures::phi(results, axis, typical, |_| false, None),
        };
        all.push(figure(
            id.to_owned(),
            title.to_owned(),
            "EAM, a mean over the frames of a point,",
            Typical::Mean,
        ));
        let medians =
            "Medians over the frames of a point of the absolute error, which single failures cannot ruin,";
        all.push(figure(format!("{id}-medians"), format!("{title}, medians"), medians, Typical::Median));
    }
    all
}

/// Frames with a truth in groups of alike speed, as many in each.
fn speed_axis(results: &RealResults<'_>, moving: Quantity, (title, name): (&'static str, &str)) -> SpeedAxis {
    let mut speeds = speeds(results, moving, |record| record.truth.is_some());
    speeds.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let groups = (speeds.len() / LEAST_FRAMES).clamp(1, MOST_GROUPS);
    let bounds = |k: usize| k * speeds.len() / groups;
    let group = |k| {
        let group = &speeds[bounds(k)..bounds(k + 1)];
        Some(SpeedPlace::of_frames(median_speed(group)?, group.iter().map(|(_, frame)| *frame).collect()))
    };
    SpeedAxis { title, axis: Axis::linear(name), places: (0..groups).filter_map(group).collect() }
}

/// Errors of tZ and ΩY of every frame, or their estimates where there is no truth.
fn from_frame_to_frame(name: &str, results: &RealResults<'_>) -> Figure {
    let (what, panels) = if results.have_truth() {
        let panel = |letter, quantity: Quantity| {
            let y = Axis::log(format!("|error| of {}", quantity.heading()));
            frames_panel(results, letter, quantity, y, |record| record.eam)
        };
        ("Errors of φ", [panel('a', Quantity::Tz), panel('b', Quantity::Wy)])
    } else {
        let panel = |letter, quantity: Quantity| {
            frames_panel(results, letter, quantity, Axis::linear(quantity.heading()), |record| {
                Some(record.estimate)
            })
        };
        ("φ", [panel('a', Quantity::Tz), panel('b', Quantity::Wy)])
    };
    Figure {
        id: "recording-frames".to_owned(),
        title: format!("{what} from frame to frame: {name}"),
        caption: format!(
            "The forward translation and the turn about the vertical. DCCE, DV and (22) by least median of squares, ML by \
             maximum likelihood. {INPUT}"
        ),
        columns: 2,
        panels: panels.to_vec(),
    }
}

fn frames_panel(
    results: &RealResults<'_>,
    letter: char,
    quantity: Quantity,
    y: Axis,
    value: fn(&RealRecord) -> Option<f64>,
) -> Panel {
    let line = |(approach, method, estimator)| {
        let contender = ImageContender::new(approach, method, estimator);
        let chosen =
            results.records.iter().filter(move |r| r.contender == Some(contender) && r.quantity == quantity);
        let mut points: Vec<(f64, f64)> = chosen.filter_map(|r| Some((r.pose as f64, value(r)?))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Series::through(&contender.legend(), Line::Solid, points)
    };
    let contenders = [
        (Approach::Differential, Method::Dcce, ImageEstimator::Lmeds),
        (Approach::Differential, Method::Dv, ImageEstimator::Lmeds),
        (Approach::Discrete, Method::Linear22, ImageEstimator::Lmeds),
        (Approach::Discrete, Method::Ml, ImageEstimator::Ml),
    ];
    let series = contenders.map(line).to_vec();
    let content = Content::Plot { x: Axis::linear("frame"), y, series };
    Panel { title: format!("({letter}) {}", quantity.symbol()), content }
}
