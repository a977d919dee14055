//! The parts of a chart: axes, ticks and paths. No coordinate that is not finite leaves this file.

use std::fmt::Write as _;

use maud::{Markup, html};

use super::number::tick;

/// From data to SVG units along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AxisScale {
    from: (f64, f64),
    to: (f64, f64),
    log: bool,
}

impl AxisScale {
    /// A linear scale; an empty or broken range is opened around its middle.
    pub(crate) fn linear((lo, hi): (f64, f64), to: (f64, f64)) -> Self {
        let (lo, hi) = if lo.is_finite() && hi.is_finite() { (lo, hi) } else { (0.0, 1.0) };
        let least = 1e-9 + 1e-9 * lo.abs().max(hi.abs());
        let from = if hi - lo > least { (lo, hi) } else { (lo - 0.5 * least, lo + 0.5 * least) };
        Self { from, to, log: false }
    }

    /// A logarithmic scale over a positive range.
    pub(crate) fn log((lo, hi): (f64, f64), to: (f64, f64)) -> Self {
        let lo = if lo.is_finite() && lo > 1e-290 { lo.min(1e290) } else { 1e-3 };
        let hi = if hi.is_finite() && hi > lo { hi } else { lo * 10.0 };
        Self { from: (lo, hi), to, log: true }
    }

    /// The range of data.
    pub(crate) fn range(&self) -> (f64, f64) {
        self.from
    }

    /// Where `value` lies; far outside it is held near the edge, and what is not a number is nowhere.
    pub(crate) fn at(&self, value: f64) -> Option<f64> {
        let f = |v: f64| if self.log { v.max(1e-300).ln() } else { v };
        let (lo, hi) = (f(self.from.0), f(self.from.1));
        let share = (f(value) - lo) / (hi - lo);
        (!share.is_nan()).then(|| self.to.0 + share.clamp(-3.0, 4.0) * (self.to.1 - self.to.0))
    }

    /// About `n` round values with their labels.
    pub(crate) fn ticks(&self, n: usize) -> Vec<(f64, String)> {
        if n == 0 {
            return Vec::new();
        }
        if self.log { self.log_ticks(n) } else { self.linear_ticks(n) }
    }

    fn linear_ticks(&self, n: usize) -> Vec<(f64, String)> {
        let (lo, hi) = self.from;
        let rough = (hi - lo) / n as f64;
        let decade = 10f64.powf(rough.log10().floor());
        let round =
            [1.0, 2.0, 2.5, 5.0, 10.0].into_iter().find(|s| s * decade >= rough * 0.85).unwrap_or(10.0);
        let step = round * decade;
        let decimals = (-step.log10().floor()).max(0.0) as usize + usize::from(round == 2.5 && decade < 5.0);
        let first = (lo / step).ceil() as i64;
        let last = (hi / step).floor() as i64;
        (first..=last.min(first.saturating_add(50)))
            .map(|k| k as f64 * step)
            .map(|v| (v, tick(v, decimals)))
            .collect()
    }

    fn log_ticks(&self, n: usize) -> Vec<(f64, String)> {
        let (lo, hi) = self.from;
        let decades = lo.log10().floor() as i32..=hi.log10().ceil() as i32;
        let of = |steps: &[f64]| -> Vec<(f64, String)> {
            let all = decades.clone().flat_map(|e| steps.iter().map(move |s| (*s, e)));
            let valued = all.map(|(s, e)| {
                let decimals = (-e).max(0) as usize + usize::from(s.fract() > 0.0 && e <= 0);
                let value = s * 10f64.powi(e);
                (value, tick(value, decimals))
            });
            valued.filter(|(v, _)| (lo * 0.999..=hi * 1.001).contains(v)).collect()
        };
        let choices: [&[f64]; 4] =
            [&[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0], &[1.0, 2.0, 3.0, 5.0], &[1.0, 2.0, 5.0], &[1.0]];
        let mut ticks = choices.map(of).into_iter().skip_while(|t| t.len() > n + 1);
        // Of many decades only some get a label.
        let some =
            || of(choices[3]).into_iter().step_by((hi / lo).log10().max(1.0) as usize / n + 1).collect();
        ticks.next().unwrap_or_else(some)
    }
}

/// The frame a chart is drawn in: two scales, and what surrounds them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axes {
    /// To the right.
    pub x: AxisScale,
    /// Upwards.
    pub y: AxisScale,
}

/// Space for labels around a chart: left, right, top, bottom.
pub(crate) const MARGIN: [f64; 4] = [50.0, 8.0, 8.0, 34.0];

impl Axes {
    /// Where the point (x, y) lies.
    pub(crate) fn at(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        Some((self.x.at(x)?, self.y.at(y)?))
    }

    /// Left, top, width and height of the inside.
    pub(crate) fn inside(&self) -> [f64; 4] {
        let ((left, right), (bottom, top)) = (self.x.to, self.y.to);
        [left, top, right - left, bottom - top]
    }

    /// Grid lines, tick labels and axis names.
    pub(crate) fn grid(&self, x_name: &str, y_name: &str, ticks: (usize, usize)) -> Markup {
        let [left, top, width, height] = self.inside();
        let (right, bottom) = (left + width, top + height);
        html! {
            g class="grid" {
                @for (v, label) in self.x.ticks(ticks.0) {
                    @if let Some(x) = self.x.at(v) {
                        path d=(format!("M{x:.1} {top:.1}V{bottom:.1}")) {}
                        text x=(format!("{x:.1}")) y=(format!("{:.1}", bottom + 14.0)) text-anchor="middle" { (label) }
                    }
                }
                @for (v, label) in self.y.ticks(ticks.1) {
                    @if let Some(y) = self.y.at(v) {
                        path d=(format!("M{left:.1} {y:.1}H{right:.1}")) {}
                        text x=(format!("{:.1}", left - 5.0)) y=(format!("{:.1}", y + 3.5)) text-anchor="end" { (label) }
                    }
                }
                text class="name" x=(format!("{right:.1}")) y=(format!("{:.1}", bottom + 28.0)) text-anchor="end" { (x_name) }
                @if !y_name.is_empty() {
                    text class="name" x=(format!("{:.1}", left)) y=(format!("{:.1}", top - 7.0)) { (y_name) }
                }
            }
        }
    }
}

/// A path through points in SVG units that starts anew after each gap; lone points become short dashes.
pub(crate) fn path(points: impl IntoIterator<Item = Option<(f64, f64)>>) -> String {
    let (mut d, mut pen) = (String::new(), false);
    let mut lone = None;
    let dash = |d: &mut String, lone: Option<(f64, f64)>| {
        if lone.is_some() {
            d.push_str("h2");
        }
    };
    for point in points {
        let point = point.filter(|(x, y)| x.is_finite() && y.is_finite());
        match point {
            Some((x, y)) => {
                // Writing to a string cannot fail.
                let _ = write!(d, "{}{x:.1} {y:.1}", if pen { 'L' } else { 'M' });
                lone = if pen { None } else { point };
            }
            None => dash(&mut d, lone.take()),
        }
        pen = point.is_some();
    }
    dash(&mut d, lone);
    d
}

/// The area between two curves (x, low, high) in SVG units, in pieces between gaps.
pub(crate) fn band(points: &[Option<(f64, f64, f64)>]) -> String {
    let mut d = String::new();
    for piece in points.split(Option::is_none) {
        let piece: Vec<_> = piece.iter().flatten().collect();
        let (Some(first), Some(last)) = (piece.first(), piece.last()) else { continue };
        // A lone point gets a width, so that it can be seen.
        let wide = if piece.len() == 1 { 2.0 } else { 0.0 };
        let _ = write!(d, "M{:.1} {:.1}", first.0 - wide, first.1);
        for (x, low, _) in &piece {
            let _ = write!(d, "L{:.1} {low:.1}", x + wide);
        }
        let _ = write!(d, "L{:.1} {:.1}", last.0 + wide, last.2);
        for (x, _, high) in piece.iter().rev() {
            let _ = write!(d, "L{:.1} {high:.1}", x - wide);
        }
        d.push('Z');
    }
    d
}

/// Least and greatest of the finite values.
pub(crate) fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|v| v.is_finite()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((lo, hi)) => Some((v.min(lo), v.max(hi))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let labels = |scale: AxisScale, n| scale.ticks(n).into_iter().map(|(_, l)| l).collect::<Vec<_>>();
        assert_eq!(
            labels(AxisScale::linear((-0.2, 1.1), (0.0, 1.0)), 5),
            ["0.00", "0.25", "0.50", "0.75", "1.00"]
        );
        assert_eq!(labels(AxisScale::linear((-3.0, 3.0), (0.0, 1.0)), 3), ["−2", "0", "2"]);
        assert_eq!(labels(AxisScale::log((0.4, 30.0), (0.0, 1.0)), 6), ["0.5", "1", "2", "5", "10", "20"]);
        for range in
            [(f64::NAN, 1.0), (2.0, 2.0), (5.0, -5.0), (-1e308, 1e308), (0.0, f64::INFINITY), (1e300, 1e300)]
        {
            for scale in [AxisScale::linear(range, (0.0, 100.0)), AxisScale::log(range, (0.0, 100.0))] {
                assert!(scale.ticks(5).len() < 60);
                for value in [0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308] {
                    assert!(scale.at(value).is_none_or(|at| at.abs() <= 400.0), "{range:?} {value}");
                }
            }
        }
    }

    #[test]
    fn a_path_starts_anew_after_a_gap() {
        let points =
            [Some((0.0, 0.0)), Some((1.0, 1.0)), None, Some((3.0, f64::NAN)), Some((4.0, 4.0)), None];
        assert_eq!(path(points), "M0.0 0.0L1.0 1.0M4.0 4.0h2");
        assert_eq!(path([]), "");
    }

    #[test]
    fn a_band_closes_each_piece() {
        let d = band(&[Some((0.0, 1.0, 2.0)), Some((1.0, 1.0, 3.0)), None, Some((5.0, 0.0, 1.0))]);
        assert_eq!(d.matches('M').count(), 2);
        assert_eq!(d.matches('Z').count(), 2);
        assert!(d.starts_with("M0.0 1.0L0.0 1.0L1.0 1.0L1.0 3.0L1.0 3.0L0.0 2.0Z"), "{d}");
    }
}
