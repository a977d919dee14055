//! Where the time of a frame goes.

use std::time::Instant;

use serde::{Deserialize, Serialize};

/// Milliseconds spent in each stage of one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Pyramids and gradients.
    pub pyramids_ms: f64,
    /// Dense disparity.
    pub disparity_ms: f64,
    /// Corner tracks and the motion they predict.
    pub tracks_ms: f64,
    /// Dense flow.
    pub flow_ms: f64,
    /// φ and its covariance.
    pub estimate_ms: f64,
    /// Depth velocity and time to impact.
    pub maps_ms: f64,
}

/// Run a stage and add its time.
pub(super) fn timed<T>(total_ms: &mut f64, run: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let value = run();
    *total_ms += start.elapsed().as_secs_f64() * 1e3;
    value
}
