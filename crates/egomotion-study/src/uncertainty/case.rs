//! One case: a predicted variance beside the empirical one.

use egomotion::geometry::distribution::NORMAL_P975_MEDIUM;
use serde::{Deserialize, Serialize};

use super::formula::{Family, FormulaKind, Inputs};

/// A predicted variance beside the empirical one, at one place with its noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VarianceCase {
    /// The estimator.
    pub family: Family,
    /// Number of the formula: `(39c)`.
    pub formula: String,
    /// Whether the formula is printed, corrected, ….
    pub kind: FormulaKind,
    /// The inputs that are drawn.
    pub inputs: Inputs,
    /// The quantity that is estimated. Variances are in px² for a disparity, in mm² for all others.
    pub quantity: String,
    /// Sequence.
    pub sequence: String,
    /// Multiple of its motion.
    pub step: f64,
    /// The place and its noise; `None` over all points of the sequence's view.
    pub place: Option<SampledPlace>,
    /// Disparity levels per pixel, where disparity is rounded.
    pub levels: Option<usize>,
    /// Predicted variance.
    pub predicted: f64,
    /// Variance over the draws.
    pub empirical: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Draws.
    pub draws: usize,
}

/// Place and noise of a case.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SampledPlace {
    /// Reference pose exp(k φ).
    pub pose: i32,
    /// Pixel (u, v).
    pub pixel: (usize, usize),
    /// Depth, in metres.
    pub depth_m: f64,
    /// Length of the flow, in pixels per interval.
    pub flow_px: f64,
    /// σ_d, in pixels.
    pub sigma_disparity_px: f64,
    /// σ_v, in pixels.
    pub sigma_flow_px: f64,
    /// σ_d/d.
    pub relative: f64,
}

impl VarianceCase {
    /// Empirical over predicted.
    pub fn ratio(&self) -> f64 {
        self.empirical / self.predicted
    }

    /// Its 95 % interval.
    pub fn interval(&self) -> (f64, f64) {
        let half = NORMAL_P975_MEDIUM * self.standard_error / self.predicted;
        (self.ratio() - half, self.ratio() + half)
    }

    /// σ_d/d; 0 over all points, where there is rounding alone.
    pub fn relative(&self) -> f64 {
        self.place.map_or(0.0, |place| place.relative)
    }
}
