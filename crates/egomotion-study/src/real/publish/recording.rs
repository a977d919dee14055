//! Tables 3 to 7 for a recording, and its errors from frame to frame.

use super::RealResults;
use super::tables::{contenders, mean_and_scatter};
use crate::real::contender::{ImageContender, ImageEstimator};
use crate::real::quantity::Quantity;
use crate::real::statistics::PooledStatistics;
use crate::synthetic::{APPROACHES, approach_name};
use crate::{Axis, Cell, Content, Figure, Line, Panel, Series, Table};
use egomotion::pipeline::{Approach, Method};

/// VZ as in Tables 3 and 6, then φ and its errors as in Tables 4, 5 and 7.
pub(super) fn tables(name: &str, results: &RealResults<'_>) -> Vec<Table> {
    let mut tables = vec![vz(name, results)];
    for approach in APPROACHES {
        tables.push(phi(name, results, approach));
        tables.push(errors(name, results, approach));
    }
    tables
}

fn vz(name: &str, results: &RealResults<'_>) -> Table {
    let mut table = Table::new(
        "recording-vz",
        "VZ, in the form of Tables 3 and 6",
        "mm per frame. The recording has no truth of VZ: the true one is what the true φ does to a still scene of the measured depth, \
         so that its noise and everything that moves by itself count as errors.",
        &[
            ("approach", "approach"),
            ("method", "method"),
            ("estimated", "VZ (mm)"),
            ("true", "of the still scene"),
            ("erm_signed", "ERM, signed (%)"),
            ("erm_abs", "ERM (%)"),
            ("std", "STD (%)"),
            ("n", "frames"),
        ],
    );
    let pixel = |approach, method| ImageContender::new(approach, method, ImageEstimator::Pixel);
    for contender in [
        pixel(Approach::Differential, Method::Dcce),
        pixel(Approach::Differential, Method::Dv),
        pixel(Approach::Discrete, Method::Dcce),
        pixel(Approach::Discrete, Method::Dv),
        ImageContender::BEST,
    ] {
        let Some(found) = results.get(name, Some(contender), Quantity::VzStill) else { continue };
        let [approach, method, _] = contender.names();
        let mut cells: Vec<Cell> =
            vec![approach.into(), method.into(), found.estimate.into(), found.truth.into()];
        cells.extend([found.erm_signed, found.erm_abs, found.std_percent].map(Cell::from));
        cells.push(found.n.into());
        table.rows.push(cells);
    }
    table
}

fn columns() -> Vec<(&'static str, &'static str)> {
    let phi = Quantity::PHI.map(|quantity| (quantity.name(), quantity.heading()));
    [("row", "")].into_iter().chain(phi).chain([("n", "frames")]).collect()
}

fn phi(name: &str, results: &RealResults<'_>, approach: Approach) -> Table {
    let word = approach_name(approach);
    let mut table = Table::new(
        &format!("recording-phi-{word}"),
        &format!("φ, {word} approach, in the form of Tables 4, 5 and 7"),
        "mm and degrees per frame, of the left camera: mean ± standard deviation over the frames, which includes that of \
         the motion itself.",
        &columns(),
    );
    let contenders = contenders(approach);
    let mut exact: Vec<Cell> = vec!["exact".into()];
    let truth = |quantity| {
        let contender = contenders.first().copied();
        results.get(name, contender, quantity).map(|found| PooledStatistics {
            estimate: found.truth,
            scatter: 0.0,
            ..found
        })
    };
    exact.extend(Quantity::PHI.map(|quantity| Cell::from(truth(quantity).map(|found| found.estimate))));
    exact.push(Cell::Empty);
    table.rows.push(exact);
    for contender in contenders {
        let found = |quantity| results.get(name, Some(contender), quantity);
        let mut cells: Vec<Cell> = vec![contender.label().into()];
        cells.extend(Quantity::PHI.map(|quantity| mean_and_scatter(found(quantity), quantity)));
        cells.push(found(Quantity::Tz).map(|found| found.n).into());
        table.rows.push(cells);
    }
    table
}

fn errors(name: &str, results: &RealResults<'_>, approach: Approach) -> Table {
    let word = approach_name(approach);
    let mut table = Table::new(
        &format!("recording-errors-{word}"),
        &format!("Errors of φ from frame to frame, {word} approach"),
        "EAM: the mean over the frames of the absolute error, in mm and degrees per frame. Poses that come with a recording \
         have errors of their own.",
        &columns(),
    );
    for contender in contenders(approach) {
        let found = Quantity::PHI.map(|quantity| results.get(name, Some(contender), quantity));
        let mut cells: Vec<Cell> = vec![contender.label().into()];
        cells.extend(found.each_ref().map(|found| Cell::from(found.as_ref().map(|found| found.eam))));
        cells.push(found[2].as_ref().map(|found| found.n).into());
        table.rows.push(cells);
    }
    table
}

/// Errors of tZ and ΩY from frame to frame.
pub(super) fn figures(results: &RealResults<'_>) -> Vec<Figure> {
    let panel = |(i, quantity): (usize, Quantity)| Panel {
        title: format!("({}) {}", ["a", "b"][i], quantity.heading()),
        content: Content::Plot {
            x: Axis::linear("frame"),
            y: Axis::log(format!("|error of {}|", quantity.heading())),
            series: lines(results, quantity),
        },
    };
    vec![Figure {
        id: "recording-errors".to_owned(),
        title: "Errors of φ from frame to frame".to_owned(),
        caption: "Absolute error of the forward translation and of the turn about the vertical, by least squares and by \
                  maximum likelihood."
            .to_owned(),
        columns: 1,
        panels: [Quantity::Tz, Quantity::Wy].into_iter().enumerate().map(panel).collect(),
    }]
}

fn lines(results: &RealResults<'_>, quantity: Quantity) -> Vec<Series> {
    let line = |(approach, method, estimator, name): (Approach, Method, ImageEstimator, &str)| {
        let contender = ImageContender::new(approach, method, estimator);
        let chosen =
            results.records.iter().filter(|r| r.contender == Some(contender) && r.quantity == quantity);
        Series::through(name, Line::Solid, chosen.map(|r| (r.pose as f64, r.eam)))
    };
    [
        (Approach::Differential, Method::Dcce, ImageEstimator::Ls, "DCCE/DIFF"),
        (Approach::Differential, Method::Dv, ImageEstimator::Ls, "DV/DIFF"),
        (Approach::Discrete, Method::Rigid, ImageEstimator::Ls, "(22) with a rotation"),
        (Approach::Discrete, Method::Ml, ImageEstimator::Ml, "maximum likelihood"),
    ]
    .map(line)
    .to_vec()
}
