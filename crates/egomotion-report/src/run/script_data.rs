//! What the script needs to name the values under the pointer.

use serde_json::{Value, json};

use super::time_series::TimeSeries;
use super::timeline::Timeline;

/// Times, frames and series as JSON that cannot end its own element.
pub(crate) fn json(timeline: &Timeline<'_>, series: &[&TimeSeries]) -> String {
    let named: serde_json::Map<String, Value> =
        series.iter().map(|series| (series.id.clone(), series.json())).collect();
    // Times need all their digits to be told apart.
    let times: Vec<Value> = timeline.times.iter().map(|t| json!((1e4 * t).round() / 1e4)).collect();
    let data = json!({
        "time": times,
        "frame": timeline.rows.iter().map(|row| row.frame).collect::<Vec<_>>(),
        "stop": timeline.slider_times.iter().map(|t| json!((1e4 * t).round() / 1e4)).collect::<Vec<_>>(),
        "series": named,
    });
    data.to_string().replace('<', "\\u003c")
}
