//! What charts over time show: rows on one time axis, and series of values with their bands.

use serde_json::{Value, json};

use super::{FrameRow, Interval, Report};

/// Most points of a curve; of a longer run every so-many-th row is drawn.
const MOST_POINTS: usize = 1500;

/// The rows that are drawn, and what all charts over time mark.
#[derive(Debug, Clone)]
pub struct Timeline<'a> {
    /// The rows drawn.
    pub rows: Vec<&'a FrameRow>,
    /// Their times.
    pub times: Vec<f64>,
    /// The axis' name.
    pub name: &'static str,
    /// Least and greatest time, with some room.
    pub range: (f64, f64),
    /// Time of each place of the slider.
    pub stops: Vec<f64>,
    /// Times of the rows that asked for an answer and got none; of all rows.
    pub unanswered: Vec<f64>,
}

impl<'a> Timeline<'a> {
    /// The time axis of a run.
    pub fn of(report: &Report<'a>) -> Self {
        let (times, name) = report.times();
        let step = times.len().div_ceil(MOST_POINTS).max(1);
        let unanswered =
            report.frames.iter().zip(&times).filter(|(row, _)| row.asks() && row.motion.is_none());
        let (first, last) = times.first().zip(times.last()).map_or((0.0, 1.0), |(a, b)| (*a, *b));
        let room = if last > first { 0.5 * (last - first) / times.len().max(2) as f64 } else { 0.5 };
        Self {
            rows: report.frames.iter().step_by(step).collect(),
            name,
            range: (first - room, last + room),
            stops: report.stops().iter().filter_map(|stop| times.get(stop.row).copied()).collect(),
            unanswered: unanswered.map(|(_, &t)| t).collect(),
            times: times.into_iter().step_by(step).collect(),
        }
    }
}

/// One quantity over the rows of a [`Timeline`].
#[derive(Debug, Clone)]
pub struct Series {
    /// Name among the page's data.
    pub id: String,
    /// Name for a reader.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Values with their 95 % bands.
    pub values: Vec<Option<Interval>>,
    /// True values.
    pub truths: Vec<Option<f64>>,
}

impl Series {
    /// Half the width of the band in the middle frame.
    pub fn usual_band(&self) -> f64 {
        let halves: Vec<f64> = self.values.iter().flatten().map(|v| 0.5 * (v.high - v.low)).collect();
        egomotion::metrics::quantile(&halves, 0.5).unwrap_or(f64::NAN)
    }

    /// Estimate − truth with the same band.
    pub fn errors(&self) -> Option<Self> {
        let off = |v: &Interval, t: f64| Interval { value: v.value - t, low: v.low - t, high: v.high - t };
        let error = |(v, t): (&Option<Interval>, &Option<f64>)| Some(off(v.as_ref()?, (*t)?));
        let values: Vec<Option<Interval>> = self.values.iter().zip(&self.truths).map(error).collect();
        values.iter().any(Option::is_some).then(|| Self {
            id: format!("{}-error", self.id),
            name: format!("{}, estimate − truth", self.name),
            unit: self.unit.clone(),
            truths: vec![None; values.len()],
            values,
        })
    }

    /// For the script: values, bands and truths, rounded.
    pub fn json(&self) -> Value {
        let column = |of: &dyn Fn(&Interval) -> f64| -> Vec<Value> {
            self.values.iter().map(|v| v.as_ref().map_or(Value::Null, |v| rounded(of(v)))).collect()
        };
        let truths: Vec<Value> = self.truths.iter().map(|t| t.map_or(Value::Null, rounded)).collect();
        json!({
            "name": self.name,
            "unit": self.unit,
            "value": column(&|v| v.value),
            "low": column(&|v| v.low),
            "high": column(&|v| v.high),
            "truth": if self.truths.iter().any(Option::is_some) { truths } else { Vec::new() },
        })
    }
}

/// Five digits; null where it is not finite.
pub fn rounded(value: f64) -> Value {
    format!("{value:.4e}").parse::<f64>().ok().filter(|v| v.is_finite()).map_or(Value::Null, |v| json!(v))
}
