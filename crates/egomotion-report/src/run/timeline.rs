//! The time axis that all charts of a run share.

use super::report::{FrameRow, Report};

/// Most points of a curve: several a pixel of the widest chart. Longer runs show every n-th row.
const MAX_POINTS: usize = 1500;

/// The rows that are drawn, and what all charts over time mark.
#[derive(Debug, Clone)]
pub(crate) struct Timeline<'a> {
    /// The rows drawn.
    pub rows: Vec<&'a FrameRow>,
    /// Their times.
    pub times: Vec<f64>,
    /// The axis' name.
    pub name: &'static str,
    /// Least and greatest time, with some room.
    pub range: (f64, f64),
    /// Time of each place of the slider.
    pub slider_times: Vec<f64>,
    /// Times of the rows that asked for an answer and got none; of all rows.
    pub unanswered: Vec<f64>,
}

impl<'a> Timeline<'a> {
    /// The time axis of a run.
    pub(crate) fn of(report: &Report<'a>) -> Self {
        let (times, name) = report.times();
        let step = times.len().div_ceil(MAX_POINTS).max(1);
        let unanswered =
            report.frames.iter().zip(&times).filter(|(row, _)| row.asks() && row.motion.is_none());
        let (first, last) = times.first().zip(times.last()).map_or((0.0, 1.0), |(a, b)| (*a, *b));
        let room = if last > first { 0.5 * (last - first) / times.len().max(2) as f64 } else { 0.5 };
        Self {
            rows: report.frames.iter().step_by(step).collect(),
            name,
            range: (first - room, last + room),
            slider_times: report
                .slider_positions()
                .iter()
                .filter_map(|at| times.get(at.row).copied())
                .collect(),
            unanswered: unanswered.map(|(_, &t)| t).collect(),
            times: times.into_iter().step_by(step).collect(),
        }
    }
}
