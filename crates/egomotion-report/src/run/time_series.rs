//! One quantity over time, with its band and the truth.

use serde_json::{Value, json};

use super::interval::Interval;

/// One quantity over the rows of a [`Timeline`](super::timeline::Timeline).
#[derive(Debug, Clone)]
pub(crate) struct TimeSeries {
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

impl TimeSeries {
    /// Half the width of the band in the middle frame.
    pub(crate) fn usual_band(&self) -> f64 {
        let halves: Vec<f64> = self.values.iter().flatten().map(|v| 0.5 * (v.high - v.low)).collect();
        egomotion::metrics::quantile(&halves, 0.5).unwrap_or(f64::NAN)
    }

    /// Estimate − truth with the same band.
    pub(crate) fn errors(&self) -> Option<Self> {
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
    pub(crate) fn json(&self) -> Value {
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
pub(crate) fn rounded(value: f64) -> Value {
    format!("{value:.4e}").parse::<f64>().ok().filter(|v| v.is_finite()).map_or(Value::Null, |v| json!(v))
}
