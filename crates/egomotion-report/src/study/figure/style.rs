//! Which colour, mark and dash a series has, told by its name.

use egomotion_study::{Content, Figure, Line, Series};
use maud::{Markup, html};

/// Okabe and Ito's colours, told apart by colour-blind eyes; their yellow is too pale for a line on white.
const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#882255"];

/// Dashes of reference lines, in their order.
const REFERENCE_DASHES: [&str; 4] = ["none", "6 3", "2 2.5", "8 2 2 2"];

/// Shapes of marks; seven, so that with eight colours 56 series differ.
const SHAPES: [Shape; 7] =
    [Shape::Circle, Shape::Square, Shape::Up, Shape::Diamond, Shape::Down, Shape::Plus, Shape::Cross];

/// The shape of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Circle,
    Square,
    Up,
    Diamond,
    Down,
    Plus,
    Cross,
}

/// How one series looks.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Style {
    pub name: String,
    pub line: Line,
    pub colour: &'static str,
    pub dash: &'static str,
    pub shape: Option<Shape>,
}

/// One style for each name of a figure, in the order of their first appearance.
pub(crate) fn styles(figure: &Figure) -> Vec<Style> {
    let mut styles: Vec<Style> = Vec::new();
    let plots = figure.panels.iter().filter_map(|panel| match &panel.content {
        Content::Plot { series, .. } => Some(series),
        Content::Map { .. } | Content::Picture(_) => None,
    });
    for series in plots.flatten() {
        if !styles.iter().any(|style| style.name == series.name) {
            let alike = |style: &&Style| (style.line == Line::Reference) == (series.line == Line::Reference);
            styles.push(Style::new(series, styles.iter().filter(alike).count()));
        }
    }
    styles
}

impl Style {
    /// The style of the `k`-th name among the references, or among the others.
    fn new(series: &Series, k: usize) -> Self {
        let reference = series.line == Line::Reference;
        let dash = match series.line {
            Line::Reference => REFERENCE_DASHES[k % REFERENCE_DASHES.len()],
            Line::Dashed => "5 3",
            Line::Solid | Line::Marks => "none",
        };
        Self {
            name: series.name.clone(),
            line: series.line,
            colour: if reference { "#7a7f86" } else { COLOURS[k % COLOURS.len()] },
            dash,
            shape: (!reference).then(|| SHAPES[k % SHAPES.len()]),
        }
    }

    /// The style of this series, which bears the name of `self` but may be drawn otherwise.
    pub(crate) fn of(&self, series: &Series) -> Self {
        let dash = match series.line {
            Line::Dashed => "5 3",
            Line::Reference => self.dash,
            Line::Solid | Line::Marks => "none",
        };
        Self { line: series.line, dash, ..self.clone() }
    }

    /// A line along a path.
    pub(crate) fn stroke(&self, d: &str) -> Markup {
        let width = if self.line == Line::Reference { "1.3" } else { "1.6" };
        html! {
            @if self.line != Line::Marks && !d.is_empty() {
                path d=(d) fill="none" stroke=(self.colour) stroke-width=(width) stroke-dasharray=(self.dash)
                    stroke-linejoin="round" {}
            }
        }
    }

    /// A mark at a place: full for full lines, open for broken ones.
    pub(crate) fn mark(&self, x: f64, y: f64) -> Markup {
        let fill = if self.line == Line::Dashed { "#fff" } else { self.colour };
        html! {
            @if let Some(shape) = self.shape {
                path d=(format!("M{x:.1} {y:.1}{}", shape.outline())) fill=(fill) stroke=(self.colour)
                    stroke-width="1.3" {}
            }
        }
    }

    /// A small full triangle at the edge, for a point beyond it.
    pub(crate) fn beyond(&self, x: f64, y: f64, upwards: bool) -> Markup {
        let d = if upwards { "m-4.5 7.5l4.5 -7.5l4.5 7.5z" } else { "m-4.5 -7.5l4.5 7.5l4.5 -7.5z" };
        html! { path d=(format!("M{x:.1} {y:.1}{d}")) fill=(self.colour) stroke="#fff" stroke-width="0.7" {} }
    }

    /// What stands before the name in a legend, in 30 × 12 units.
    pub(crate) fn sample(&self) -> Markup {
        html! { (self.stroke("M1 6H29")) (self.mark(15.0, 6.0)) }
    }
}

impl Shape {
    /// The outline from the middle, about 6 units across, all of one apparent size.
    fn outline(self) -> &'static str {
        match self {
            Self::Circle => "m-3 0a3 3 0 1 0 6 0a3 3 0 1 0 -6 0z",
            Self::Square => "m-2.7 -2.7h5.4v5.4h-5.4z",
            Self::Up => "m0 -3.8l3.4 5.9h-6.8z",
            Self::Diamond => "m0 -3.8l3.8 3.8l-3.8 3.8l-3.8 -3.8z",
            Self::Down => "m0 3.8l3.4 -5.9h-6.8z",
            Self::Plus => "m-3.6 0h7.2m-3.6 -3.6v7.2",
            Self::Cross => "m-2.8 -2.8l5.6 5.6m0 -5.6l-5.6 5.6",
        }
    }
}
