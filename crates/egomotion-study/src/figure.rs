//! A figure as a value: panels in a grid, each with axes and lines, or a map, or a picture.

use egomotion::geometry::{Field, Image};

/// A figure: panels in rows of `columns`.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Stem of its file's name: `figure-07`.
    pub id: String,
    /// Its title, with the paper's number where it is one of the paper's: `Figure 7. Error of VZ …`.
    pub title: String,
    /// A sentence or two on how to read it.
    pub caption: String,
    /// Panels in a row.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// One panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Its heading, as `(a) disparity resolution`.
    pub title: String,
    /// Its content.
    pub content: Content,
}

/// The content of a panel.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// Lines over two axes.
    Plot {
        /// The axis to the right.
        x: Axis,
        /// The axis upwards.
        y: Axis,
        /// The lines, drawn in this order and named in the legend.
        series: Vec<Series>,
    },
    /// A quantity at every pixel, in false colours with a bar; missing pixels are blank.
    Map {
        /// The quantity.
        field: Field,
        /// Its name and unit, beside the bar.
        name: String,
        /// Ends of the bar; values beyond them are drawn as the ends.
        range: (f32, f32),
    },
    /// Grey levels 0 … 255.
    Picture(Image),
}

/// An axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Name and unit: `ERM (%)`.
    pub name: String,
    /// How values are laid out.
    pub layout: Layout,
}

/// How values are laid out along an axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Layout {
    /// In proportion.
    Linear,
    /// By their logarithm; values that are not positive are left out.
    Log,
    /// Named places 0, 1, 2 … at equal distances: `Inf.`, `32`, `16` ….
    Places(Vec<String>),
}

/// One line of a plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend; the same name has the same colour in every panel of a figure.
    pub name: String,
    /// How it is drawn.
    pub line: Line,
    /// Its points, from left to right.
    pub points: Vec<Point>,
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// A full line with marks.
    Solid,
    /// A broken line with marks.
    Dashed,
    /// Marks alone.
    Marks,
    /// A thin grey line without marks: a truth, a bound, the paper's own values.
    Reference,
}

/// One point of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Place along the x axis.
    pub x: f64,
    /// Place along the y axis.
    pub y: f64,
    /// Standard error of y, drawn as a bar of ± 2.
    pub standard_error: Option<f64>,
}

impl Figure {
    /// Whether a panel of it has a line to show.
    pub(crate) fn has_a_line(&self) -> bool {
        let drawn =
            |panel: &Panel| matches!(&panel.content, Content::Plot { series, .. } if !series.is_empty());
        self.panels.iter().any(drawn)
    }
}

impl Series {
    /// A line through points without standard errors.
    pub(crate) fn through(name: &str, line: Line, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let points = points.into_iter().map(|(x, y)| Point::at(x, y)).collect();
        Self { name: name.to_owned(), line, points }
    }
}

impl Point {
    /// A point without a standard error.
    pub(crate) fn at(x: f64, y: f64) -> Self {
        Self { x, y, standard_error: None }
    }
}

impl Axis {
    /// An axis in proportion.
    pub fn linear(name: impl Into<String>) -> Self {
        Self { name: name.into(), layout: Layout::Linear }
    }

    /// A logarithmic axis.
    pub fn log(name: impl Into<String>) -> Self {
        Self { name: name.into(), layout: Layout::Log }
    }

    /// An axis of named places.
    pub fn places<T: ToString>(name: impl Into<String>, places: impl IntoIterator<Item = T>) -> Self {
        let places = places.into_iter().map(|place| place.to_string()).collect();
        Self { name: name.into(), layout: Layout::Places(places) }
    }
}
