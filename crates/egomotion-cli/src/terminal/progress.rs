//! Progress bars: on a terminal, and nothing in a pipe.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Time between two redraws of a bar whose parts take long, so that its clock goes on.
const REDRAW_INTERVAL: Duration = Duration::from_millis(500);

/// A bar over the frames of a run.
pub fn frames_bar(frames: usize, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(frames as u64);
    bar.set_style(style("{msg} {wide_bar} {pos}/{len} frames, {per_sec}, {eta} left"));
    bar
}

/// A bar over the parts of a study, of which some were done before.
pub fn parts_bar(parts: usize, done_before: usize, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(parts as u64).with_position(done_before as u64);
    bar.set_style(style("{wide_msg} {bar:30} {pos}/{len} parts, {eta} left"));
    bar.reset_eta();
    bar.enable_steady_tick(REDRAW_INTERVAL);
    bar
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
