//! Tables 3 to 7 for a recording, and its errors from frame to frame.

use super::Results;
use super::tables::{measured, ways};
use crate::real::record::Summary;
use crate::real::way::{Estimator, Quantity, Way};
use crate::{Axis, Cell, Content, Figure, Line, Panel, Point, Series, Table};
use egomotion::pipeline::{Approach, Method};

const APPROACHES: [(Approach, &str); 2] =
    [(Approach::Differential, "differential"), (Approach::Discrete, "discrete")];

/// VZ as in Tables 3 and 6, then φ and its errors as in Tables 4, 5 and 7.
pub(super) fn tables(name: &str, results: &Results<'_>) -> Vec<Table> {
    let mut tables = vec![vz(name, results)];
    for (approach, word) in APPROACHES {
        tables.push(phi(name, results, approach, word));
        tables.push(errors(name, results, approach, word));
    }
    tables
}

fn vz(name: &str, results: &Results<'_>) -> Table {
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
    let pixel = |approach, method| Way::new(approach, method, Estimator::Pixel);
    for way in [
        pixel(Approach::Differential, Method::Dcce),
        pixel(Approach::Differential, Method::Dv),
        pixel(Approach::Discrete, Method::Dcce),
        pixel(Approach::Discrete, Method::Dv),
        Way::BEST,
    ] {
        let Some(found) = results.get(name, Some(way), Quantity::VzStill) else { continue };
        let [approach, method, _] = way.names();
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

fn phi(name: &str, results: &Results<'_>, approach: Approach, word: &str) -> Table {
    let mut table = Table::new(
        &format!("recording-phi-{word}"),
        &format!("φ, {word} approach, in the form of Tables 4, 5 and 7"),
        "mm and degrees per frame, of the left camera: mean ± standard deviation over the frames, which includes that of \
         the motion itself.",
        &columns(),
    );
    let ways = ways(approach);
    let mut exact: Vec<Cell> = vec!["exact".into()];
    let truth = |quantity| {
        let way = ways.first().copied();
        results.get(name, way, quantity).map(|found| Summary { estimate: found.truth, scatter: 0.0, ..found })
    };
    exact.extend(Quantity::PHI.map(|quantity| Cell::from(truth(quantity).map(|found| found.estimate))));
    exact.push(Cell::Empty);
    table.rows.push(exact);
    for way in ways {
        let found = |quantity| results.get(name, Some(way), quantity);
        let mut cells: Vec<Cell> = vec![way.label().into()];
        cells.extend(Quantity::PHI.map(|quantity| measured(found(quantity), quantity)));
        cells.push(found(Quantity::Tz).map(|found| found.n).into());
        table.rows.push(cells);
    }
    table
}

fn errors(name: &str, results: &Results<'_>, approach: Approach, word: &str) -> Table {
    let mut table = Table::new(
        &format!("recording-errors-{word}"),
        &format!("Errors of φ from frame to frame, {word} approach"),
        "EAM: the mean over the frames of the absolute error, in mm and degrees per frame. Poses that come with a recording \
         have errors of their own.",
        &columns(),
    );
    for way in ways(approach) {
        let found = Quantity::PHI.map(|quantity| results.get(name, Some(way), quantity));
        let mut cells: Vec<Cell> = vec![way.label().into()];
        cells.extend(found.each_ref().map(|found| Cell::from(found.as_ref().map(|found| found.eam))));
        cells.push(found[2].as_ref().map(|found| found.n).into());
        table.rows.push(cells);
    }
    table
}

/// Errors of tZ and ΩY from frame to frame.
pub(super) fn figures(results: &Results<'_>) -> Vec<Figure> {
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

fn lines(results: &Results<'_>, quantity: Quantity) -> Vec<Series> {
    let line = |(approach, method, estimator, name): (Approach, Method, Estimator, &str)| {
        let way = Way::new(approach, method, estimator);
        let chosen = results.records.iter().filter(|r| r.way == Some(way) && r.quantity == quantity);
        let points = chosen.map(|r| Point { x: r.pose as f64, y: r.eam, standard_error: None });
        Series { name: name.to_owned(), line: Line::Solid, points: points.collect() }
    };
    [
        (Approach::Differential, Method::Dcce, Estimator::Ls, "DCCE/DIFF"),
        (Approach::Differential, Method::Dv, Estimator::Ls, "DV/DIFF"),
        (Approach::Discrete, Method::Rigid, Estimator::Ls, "(22) with a rotation"),
        (Approach::Discrete, Method::Ml, Estimator::Ml, "maximum likelihood"),
    ]
    .map(line)
    .to_vec()
}
