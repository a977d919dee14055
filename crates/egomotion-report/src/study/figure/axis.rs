//! One axis of a plot: its range, its ticks, and the room that their labels take.

use egomotion::metrics::quantile;
use egomotion_study::{Axis, Layout};

use crate::chart::axes::{AxisScale, extent};
use crate::chart::number::significant;

/// An axis that knows its range, before it has a place on the page.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RangedAxis<'a> {
    pub name: &'a str,
    layout: &'a Layout,
    range: (f64, f64),
    /// Values that ask for a tick of their own.
    wanted: Vec<f64>,
}

impl<'a> RangedAxis<'a> {
    /// The x axis, over these values: all of them fit.
    pub(crate) fn across(axis: &'a Axis, values: &[f64]) -> Self {
        let mut distinct = known(&axis.layout, values);
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        let (lo, hi) = extent(distinct.iter().copied()).unwrap_or((1.0, 2.0));
        let log = axis.layout == Layout::Log;
        let range = match &axis.layout {
            Layout::Places(names) => (-0.5, names.len().max(1) as f64 - 0.5),
            Layout::Linear | Layout::Log => padded((lo, hi), log, 0.04),
        };
        // A sweep has a tick at each of its steps.
        let wanted = if log && distinct.len() <= 8 { distinct } else { Vec::new() };
        Self { name: &axis.name, layout: &axis.layout, range, wanted }
    }

    /// The y axis, over these values, of which single ones far from all others may lie outside.
    pub(crate) fn upwards(axis: &'a Axis, values: &[f64]) -> Self {
        let values = known(&axis.layout, values);
        let range = match &axis.layout {
            Layout::Places(names) => (-0.5, names.len().max(1) as f64 - 0.5),
            Layout::Linear => linear_range(&values),
            Layout::Log => log_range(&values),
        };
        Self { name: &axis.name, layout: &axis.layout, range, wanted: Vec::new() }
    }

    /// Whether this value can lie on the axis, inside or beyond its ends.
    pub(crate) fn takes(&self, value: f64) -> bool {
        !value.is_nan() && (*self.layout != Layout::Log || value > 0.0)
    }

    /// −1 below the range, 1 above it, 0 inside.
    pub(crate) fn side(&self, value: f64) -> i8 {
        let (lo, hi) = self.range;
        i8::from(value > hi) - i8::from(value < lo)
    }

    /// The scale onto these SVG units.
    pub(crate) fn scale(&self, to: (f64, f64)) -> AxisScale {
        match self.layout {
            Layout::Log => AxisScale::log(self.range, to),
            Layout::Linear | Layout::Places(_) => AxisScale::linear(self.range, to),
        }
    }

    /// Ticks with their labels, about `n` unless the places are named.
    pub(crate) fn ticks(&self, n: usize) -> Vec<(f64, String)> {
        match self.layout {
            Layout::Places(names) => {
                names.iter().enumerate().map(|(k, name)| (k as f64, name.clone())).collect()
            }
            _ if !self.wanted.is_empty() => {
                let label =
                    |&v: &f64| (v, significant(v, 3).trim_end_matches('0').trim_end_matches('.').to_owned());
                self.wanted
                    .iter()
                    .map(
                        |v| {
                            if v.fract() == 0.0 && v.abs() < 1e6 { (*v, format!("{v:.0}")) } else { label(v) }
                        },
                    )
                    .collect()
            }
            Layout::Linear | Layout::Log => self.scale((0.0, 1.0)).ticks(n),
        }
    }

    /// Places of unlabelled ticks between the decades of a logarithmic axis.
    pub(crate) fn minor_ticks(&self) -> Vec<f64> {
        let (lo, hi) = self.range;
        let decades = (hi / lo).log10();
        if *self.layout != Layout::Log || !self.wanted.is_empty() || !(0.5..=6.0).contains(&decades) {
            return Vec::new();
        }
        let first = lo.log10().floor() as i32;
        let all = (first..=first + 7).flat_map(|e| (2..10).map(move |k| f64::from(k) * 10f64.powi(e)));
        all.filter(|v| (lo..=hi).contains(v)).collect()
    }

    /// Whether places have names.
    pub(crate) fn is_named(&self) -> bool {
        matches!(self.layout, Layout::Places(_))
    }
}

/// Values that the axis can show.
fn known(layout: &Layout, values: &[f64]) -> Vec<f64> {
    let log = *layout == Layout::Log;
    values.iter().copied().filter(|v| v.is_finite() && (!log || *v > 0.0)).collect()
}

fn padded((lo, hi): (f64, f64), log: bool, share: f64) -> (f64, f64) {
    if log {
        let factor = if hi > lo { (hi / lo).powf(share) } else { 2.0 };
        (lo / factor, hi * factor)
    } else {
        let room = if hi > lo { share * (hi - lo) } else { 0.5 * lo.abs().max(1e-3) };
        (lo - room, hi + room)
    }
}

/// LabelSpace for all values, but not for single ones that would press the others flat.
fn linear_range(values: &[f64]) -> (f64, f64) {
    let Some((mut lo, mut hi)) = extent(values.iter().copied()) else { return (0.0, 1.0) };
    if let (8.., Some(low), Some(high)) = (values.len(), quantile(values, 0.1), quantile(values, 0.9))
        && high > low
    {
        let most = 3.0 * (high - low);
        (lo, hi) = (lo.max(low - most), hi.min(high + most));
    }
    // Errors are measured from zero.
    let (from_zero, to_zero) = (lo >= 0.0 && lo < 0.5 * hi, hi <= 0.0 && hi > 0.5 * lo);
    let (below, above) =
        padded((if from_zero { 0.0 } else { lo }, if to_zero { 0.0 } else { hi }), false, 0.06);
    (if from_zero { 0.0 } else { below }, if to_zero { 0.0 } else { above })
}

/// LabelSpace for all values down to 18 decades below the largest.
fn log_range(values: &[f64]) -> (f64, f64) {
    let Some((lo, hi)) = extent(values.iter().copied()) else { return (1.0, 10.0) };
    padded((lo.max(1e-18 * hi), hi), true, 0.06)
}
