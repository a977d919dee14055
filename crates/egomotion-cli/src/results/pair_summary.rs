//! `summary.json` of stereo pairs that have no second time: disparity alone.

use std::collections::BTreeMap;

use egomotion::geometry::StereoRig;
use egomotion::pipeline::Config;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::summary::StatusCounts;
use super::verdict::DisparityVerdict;

/// `status` of a pair.
pub const NO_MOTION: &str = "no_motion";

/// `summary.json` of a pair.
#[derive(Serialize, Deserialize)]
pub struct PairSummary {
    pub version: String,
    pub source: String,
    pub status: String,
    pub frames: usize,
    pub complete: bool,
    /// Without it disparity stays in pixels.
    pub rig: Option<StereoRig>,
    pub options: Value,
    pub config: Config,
    pub seed: u64,
    pub counts: StatusCounts,
    pub stages_ms: BTreeMap<String, f64>,
    pub frame_ms: f64,
    pub wall_s: f64,
    /// Against the source's own truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disparity: Option<DisparityVerdict>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// An index over the pairs of a set.
#[derive(Serialize)]
pub struct PairIndex {
    pub version: &'static str,
    pub source: String,
    pub options: Value,
    pub config: Config,
    pub complete: bool,
    pub scenes: BTreeMap<String, PairSummary>,
}
