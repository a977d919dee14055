//! The figures of the consistency study.

use super::CoverageBySigma;
use super::statistics::ConsistencyStatistics;
use crate::components::SYMBOLS;
use crate::{Axis, Content, Figure, Line, Panel, Series};

/// A level line across so many places.
fn level(name: &str, y: f64, count: usize) -> Series {
    Series::through(name, Line::Reference, [0.0, count.saturating_sub(1) as f64].map(|x| (x, y)))
}

/// All figures.
pub(super) fn all(statistics: &[ConsistencyStatistics]) -> Vec<Figure> {
    vec![by_sequence(statistics), by_fifth(statistics)]
}

/// NEES/6 and coverage of each sequence.
fn by_sequence(statistics: &[ConsistencyStatistics]) -> Figure {
    let names: Vec<&str> = statistics.iter().map(|v| v.name.as_str()).collect();
    let places = || Axis::places("sequence", names.iter());
    let points = |of: &dyn Fn(&ConsistencyStatistics) -> Option<f64>| {
        let found = statistics.iter().enumerate().filter_map(|(i, v)| Some((i as f64, of(v)?)));
        found.collect::<Vec<_>>().into_iter()
    };
    let nees = Content::Plot {
        x: places(),
        y: Axis::linear("NEES/6"),
        series: vec![
            level("true covariance", 1.0, names.len()),
            Series::through("NEES/6", Line::Marks, points(&|v| v.nees_over_6)),
        ],
    };
    let share = |v: Option<f64>| v.map(|share| 100.0 * share);
    let coverage = Content::Plot {
        x: places(),
        y: Axis::linear("truth inside the 95 % interval (%)"),
        series: vec![
            level("95 %", 95.0, names.len()),
            Series::through("VZ", Line::Marks, points(&|v| share(v.depth_velocity.all().coverage95()))),
            Series::through("looming", Line::Marks, points(&|v| share(v.looming.all().coverage95()))),
        ],
    };
    Figure {
        id: "consistency-sequences".into(),
        title: "Uncertainty against exact truth, by sequence".into(),
        caption: "Left: squared error of φ in units of its covariance, over its six degrees of freedom. Right: how \
                  often the 95 % interval of a pixel's VZ and looming holds the truth."
            .into(),
        columns: 2,
        panels: vec![
            Panel { title: "(a) motion".into(), content: nees },
            Panel { title: "(b) pixels".into(), content: coverage },
        ],
    }
}

/// Normalised variance by component, and share within 3 σ by σ.
fn by_fifth(statistics: &[ConsistencyStatistics]) -> Figure {
    let pooled = statistics.last();
    let numbered = |values: Vec<f64>| values.into_iter().enumerate().map(|(i, y)| (i as f64, y));
    let of = |name: &str, line, values: Option<Vec<f64>>| {
        Series::through(name, line, numbered(values.unwrap_or_default()))
    };
    let variances = Content::Plot {
        x: Axis::places(
            "component, and eigen-direction from the surest on",
            SYMBOLS.iter().zip(1..).map(|(symbol, rank)| format!("{symbol} {rank}")),
        ),
        y: Axis::linear("mean squared error over variance"),
        series: vec![
            level("true covariance", 1.0, 6),
            of("component", Line::Marks, pooled.map(|v| v.components.to_vec())),
            of("eigen-direction", Line::Marks, pooled.map(|v| v.directions.to_vec())),
        ],
    };
    let within_3_sigma =
        |by: &CoverageBySigma| by.fifths().iter().filter_map(|f| Some(100.0 * f.coverage3()?)).collect();
    let fifths = Content::Plot {
        x: Axis::places("fifth of the pixels by σ, the surest first", ["1", "2", "3", "4", "5"]),
        y: Axis::linear("within 3 σ (%)"),
        series: vec![
            level("Gaussian", 99.73, 5),
            of("VZ", Line::Solid, pooled.map(|v| within_3_sigma(&v.depth_velocity))),
            of("looming", Line::Solid, pooled.map(|v| within_3_sigma(&v.looming))),
        ],
    };
    Figure {
        id: "consistency-pooled".into(),
        title: "Uncertainty against exact truth, all sequences together".into(),
        caption: "Left: whether each component and each direction of the covariance is as wide as the errors. Right: \
                  whether the surest pixels deserve it."
            .into(),
        columns: 2,
        panels: vec![
            Panel { title: "(a) motion".into(), content: variances },
            Panel { title: "(b) pixels".into(), content: fifths },
        ],
    }
}
