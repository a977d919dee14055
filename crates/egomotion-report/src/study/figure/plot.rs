//! A panel of lines over two axes.

use egomotion_study::{Axis, Layout, Line, Point, Series};
use maud::{Markup, html};

use super::axis::RangedAxis;
use super::layout::{LabelSpace, PANEL_WIDTH, TICK_PX, TITLE_PX, text_width};
use super::style::Style;

use crate::chart::axes::{Axes, path};

/// About so many ticks along x and along y: with more their labels touch.
const TICK_COUNTS: (usize, usize) = (6, 5);
/// Most marks along one line: with more they cover it.
const MAX_MARKS: usize = 24;
/// Sine of the 30° by which long labels are turned.
const SLANT: f64 = 0.5;

/// A plot whose axes know their ranges.
pub(crate) struct Plot<'a> {
    x: RangedAxis<'a>,
    y: RangedAxis<'a>,
    series: &'a [Series],
}

impl<'a> Plot<'a> {
    pub(crate) fn new(x: &'a Axis, y: &'a Axis, series: &'a [Series]) -> Self {
        let points = || series.iter().flat_map(|series| &series.points);
        let across: Vec<f64> = points().map(|point| point.x).collect();
        let x = RangedAxis::across(x, &across);
        let seen = points().filter(|point| x.takes(point.x));
        let upwards: Vec<f64> = seen.flat_map(|point| ends(point, &y.layout)).collect();
        Self { y: RangedAxis::upwards(y, &upwards), x, series }
    }

    /// The room that labels and names take beside the plot.
    pub(crate) fn room(&self) -> LabelSpace {
        let labels = self.y.ticks(TICK_COUNTS.1);
        let widest = labels.iter().map(|(_, label)| text_width(label, TICK_PX)).fold(0.0, f64::max);
        let name = if self.y.name.is_empty() { 0.0 } else { 17.0 };
        let left = (name + widest + 10.0).min(0.45 * PANEL_WIDTH);
        LabelSpace { left, bottom: self.below(left) }
    }

    /// The room that labels and name take below the plot.
    fn below(&self, left: f64) -> f64 {
        let slant = if self.is_slanted(left) { (SLANT * self.widest_place()).min(80.0) } else { 0.0 };
        20.0 + slant + if self.x.name.is_empty() { 0.0 } else { 17.0 }
    }

    fn widest_place(&self) -> f64 {
        self.x.ticks(TICK_COUNTS.0).iter().map(|(_, label)| text_width(label, TICK_PX)).fold(0.0, f64::max)
    }

    /// Names of places that do not fit side by side are turned.
    fn is_slanted(&self, left: f64) -> bool {
        let slot = (PANEL_WIDTH - left - LabelSpace::RIGHT) / self.x.ticks(TICK_COUNTS.0).len().max(1) as f64;
        self.x.is_named() && self.widest_place() + 6.0 > slot
    }

    /// Whether anything of this plot is drawn as a bar, and whether anything lies beyond its edges.
    pub(crate) fn extras(&self) -> (bool, bool) {
        let points =
            || self.series.iter().flat_map(|series| series.points.iter().map(move |p| (series.line, p)));
        let bars = points().any(|(line, point)| line != Line::Reference && error(point).is_some());
        (bars, points().any(|(line, point)| line != Line::Reference && self.side(point) != 0))
    }

    fn side(&self, point: &Point) -> i8 {
        let shown = self.x.takes(point.x) && self.x.side(point.x) == 0 && self.y.takes(point.y);
        if shown { self.y.side(point.y) } else { 0 }
    }

    /// The plot in a panel of that height; `id` is unique on a page.
    pub(crate) fn draw(&self, room: LabelSpace, height: f64, styles: &[Style], id: &str) -> Markup {
        let axes = Axes {
            x: self.x.scale((room.left, PANEL_WIDTH - LabelSpace::RIGHT)),
            y: self.y.scale((height - room.bottom, LabelSpace::TOP)),
        };
        let [left, top, wide, tall] = axes.inside();
        let drawn: Vec<(Style, &Series)> = self
            .series
            .iter()
            .filter_map(|series| {
                Some((styles.iter().find(|style| style.name == series.name)?.of(series), series))
            })
            .collect();
        html! {
            (self.grid(&axes, room))
            clipPath id=(id) { rect x=(left) y=(top) width=(wide) height=(tall) {} }
            g clip-path=(format!("url(#{id})")) {
                @for (style, series) in &drawn {
                    (style.stroke(&path(series.points.iter().map(|point| self.place(&axes, point)))))
                    (self.bars(&axes, style, series))
                }
            }
            rect x=(left) y=(top) width=(wide) height=(tall) fill="none" stroke="#4a4f55" {}
            @for (style, series) in &drawn { (self.marks(&axes, style, series)) }
        }
    }

    fn place(&self, axes: &Axes, point: &Point) -> Option<(f64, f64)> {
        (self.x.takes(point.x) && self.y.takes(point.y)).then(|| axes.at(point.x, point.y)).flatten()
    }

    fn bars(&self, axes: &Axes, style: &Style, series: &Series) -> Markup {
        let bar = |point: &Point| {
            let reach = 2.0 * error(point)?;
            let (x, _) = self.place(axes, point)?;
            let low = point.y - reach;
            // Below the least a logarithm can show, the bar goes on to the edge.
            let low =
                if self.y.takes(low) { axes.y.at(low)? } else { axes.inside()[1] + axes.inside()[3] + 9.0 };
            let high = axes.y.at(point.y + reach)?;
            let cap = |y: f64| format!("M{:.1} {y:.1}h5", x - 2.5);
            Some(format!("M{x:.1} {low:.1}V{high:.1}{}{}", cap(low), cap(high)))
        };
        let d: String = series.points.iter().filter_map(bar).collect();
        html! { @if !d.is_empty() { path d=(d) fill="none" stroke=(style.colour) stroke-width="1" {} } }
    }

    fn marks(&self, axes: &Axes, style: &Style, series: &Series) -> Markup {
        let every =
            if style.line == Line::Marks { 1 } else { series.points.len().div_ceil(MAX_MARKS).max(1) };
        let [_, top, _, tall] = axes.inside();
        html! {
            @for (k, point) in series.points.iter().enumerate() {
                @if let Some((x, y)) = self.place(axes, point).filter(|_| self.x.side(point.x) == 0) {
                    @match self.side(point) {
                        0 if k % every == 0 => (style.mark(x, y)),
                        0 => "",
                        side if style.line != Line::Reference => {
                            (style.beyond(x, if side > 0 { top + 1.0 } else { top + tall - 1.0 }, side > 0))
                        }
                        _ => "",
                    }
                }
            }
        }
    }

    /// Grid lines, ticks, their labels and the names of the axes.
    fn grid(&self, axes: &Axes, room: LabelSpace) -> Markup {
        let [left, top, wide, tall] = axes.inside();
        let (right, bottom) = (left + wide, top + tall);
        let slanted = self.is_slanted(room.left);
        let x_ticks = placed(self.x.ticks(TICK_COUNTS.0), |v| axes.x.at(v));
        let y_ticks = placed(self.y.ticks(TICK_COUNTS.1), |v| axes.y.at(v));
        let x_labels =
            if slanted { x_ticks.clone() } else { apart(&x_ticks, |label| text_width(label, TICK_PX) + 5.0) };
        let minor_x = self
            .x
            .minor_ticks()
            .into_iter()
            .filter_map(|v| axes.x.at(v))
            .map(|x| format!("M{x:.1} {bottom:.1}v-3"));
        let minor_y = self
            .y
            .minor_ticks()
            .into_iter()
            .filter_map(|v| axes.y.at(v))
            .map(|y| format!("M{left:.1} {y:.1}h3"));
        let lines = x_ticks.iter().map(|(x, _)| format!("M{x:.1} {top:.1}V{bottom:.1}"));
        let lines = lines.chain(y_ticks.iter().map(|(y, _)| format!("M{left:.1} {y:.1}H{right:.1}")));
        let zero = axes
            .y
            .at(0.0)
            .filter(|y| self.y.takes(0.0) && !self.y.is_named() && (top..bottom - 0.5).contains(y));
        html! {
            path d=(lines.collect::<String>()) stroke="#e3e6e9" fill="none" {}
            @if let Some(y) = zero { path d=(format!("M{left:.1} {y:.1}H{right:.1}")) stroke="#9aa0a6" fill="none" {} }
            path d=(minor_x.chain(minor_y).collect::<String>()) stroke="#4a4f55" stroke-width="0.6" fill="none" {}
            g font-size=(TICK_PX) fill="#33383d" {
                @for (x, label) in &x_labels {
                    @if slanted {
                        text text-anchor="end" transform=(format!("translate({:.1} {:.1}) rotate(-30)", x + 4.0, bottom + 13.0)) { (label) }
                    } @else {
                        text text-anchor="middle" x=(format!("{x:.1}")) y=(format!("{:.1}", bottom + 14.5)) { (label) }
                    }
                }
                @for (y, label) in apart(&y_ticks, |_| TICK_PX + 1.0) {
                    text text-anchor="end" x=(format!("{:.1}", left - 5.0)) y=(format!("{:.1}", y + 3.9)) { (label) }
                }
            }
            g font-size=(TITLE_PX) text-anchor="middle" fill="#111" {
                text x=(format!("{:.1}", left + 0.5 * wide)) y=(format!("{:.1}", bottom + self.below(room.left) - 5.0)) { (self.x.name) }
                text transform=(format!("translate({:.1} {:.1}) rotate(-90)", 12.0, top + 0.5 * tall)) { (self.y.name) }
            }
        }
    }
}

fn placed(ticks: Vec<(f64, String)>, at: impl Fn(f64) -> Option<f64>) -> Vec<(f64, String)> {
    ticks.into_iter().filter_map(|(v, label)| Some((at(v)?, label))).collect()
}

/// The labels that do not run into the last one kept, each as long as `extent_of` says.
fn apart(ticks: &[(f64, String)], extent_of: impl Fn(&str) -> f64) -> Vec<(f64, String)> {
    let mut kept: Vec<(f64, String)> = Vec::new();
    for (at, label) in ticks {
        let clear =
            |last: &(f64, String)| (at - last.0).abs() >= 0.5 * (extent_of(label) + extent_of(&last.1));
        if kept.last().is_none_or(clear) {
            kept.push((*at, label.clone()));
        }
    }
    kept
}

/// A point's value, and the ends of its bar that the axis makes room for.
fn ends(point: &Point, layout: &Layout) -> [f64; 3] {
    let reach = 2.0 * error(point).unwrap_or(0.0);
    // By a logarithm the lower end may be as far as one likes.
    let low = if *layout == Layout::Log { point.y } else { point.y - reach };
    [low, point.y, point.y + reach]
}

/// The standard error, where there is one to be drawn.
fn error(point: &Point) -> Option<f64> {
    point.standard_error.filter(|e| e.is_finite() && *e > 0.0)
}
