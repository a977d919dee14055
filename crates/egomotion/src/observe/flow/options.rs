//! Settings of the dense flow.

use super::FlowError;
use documented::DocumentedFields;
use serde::{Deserialize, Serialize};

/// Level at which the search ends (0: full resolution) and the refinement begins; its answer there stands in where full
/// resolution has not enough texture. A coarser one is faster, and misses what is small.
pub(super) const FINEST_SEARCH_LEVEL: usize = 1;
/// Largest radius of the window of the refinement, in pixels, for which its columns fit into a tile.
const LARGEST_WINDOW_RADIUS_PX: usize = 15;

/// Settings of [`dense_flow`](super::dense_flow); grey levels are those of 8-bit images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct FlowOptions {
    /// Whether the initial flow stands in, as a guess, where nothing can be measured.
    pub fill: bool,
    /// Radius of the window of the refinement, 1 … 15 pixels.
    pub window_radius_px: usize,
    /// A pixel is not measured if the larger semi-axis of its covariance exceeds this, in pixels.
    pub max_sigma_px: f32,
    /// A pixel is not measured if the gradient energy along the weakest direction of its window is not this
    /// many times what noise of the size of the residual makes by itself.
    pub min_texture: f32,
    /// A pixel is not measured if the residual of its window exceeds this root mean square, in grey levels.
    pub max_residual: f32,
    /// Without initial flow, a pixel is missing if forward and backward flow disagree by more than this,
    /// in pixels; infinite: backward flow is not computed.
    pub consistency_px: f32,
}

impl Default for FlowOptions {
    fn default() -> Self {
        Self {
            fill: true,
            window_radius_px: 4,
            max_sigma_px: 0.7,
            min_texture: 1.0,
            max_residual: 15.0,
            consistency_px: 1.5,
        }
    }
}

impl FlowOptions {
    /// Refuse what lies outside its range.
    ///
    /// # Errors
    /// [`FlowError::Option`] names the rule.
    pub fn check(&self) -> Result<(), FlowError> {
        let rules = [
            (
                (1..=LARGEST_WINDOW_RADIUS_PX).contains(&self.window_radius_px),
                "window_radius_px must be 1 … 15",
            ),
            (self.max_sigma_px > 0.0, "max_sigma_px must be positive"),
            (self.min_texture >= 0.0, "min_texture must not be negative"),
            (self.max_residual > 0.0, "max_residual must be positive"),
            (self.consistency_px > 0.0, "consistency_px must be positive"),
        ];
        rules.iter().find(|(ok, _)| !ok).map_or(Ok(()), |(_, rule)| Err(FlowError::Option(rule)))
    }

    /// Weights of the refinement's window along one axis, −radius … radius, their sum 1.
    pub(super) fn window_weights(&self) -> Vec<f32> {
        let r = self.window_radius_px as f32 + 1.0;
        let weight = |i: usize| 1.0 - ((i as f32 + 1.0 - r) / r).powi(2);
        let weights: Vec<f32> = (0..2 * self.window_radius_px + 1).map(weight).collect();
        let sum: f32 = weights.iter().sum();
        weights.into_iter().map(|w| w / sum).collect()
    }

    /// Number of full-resolution pixels that share one independent error, (Σw)²/Σw² of the window: the
    /// sum of the autocorrelation of the flow's error. Who sums over pixels as if they were independent
    /// makes the covariance of the sum too small by about this factor, and by 4 more where the wider window of half
    /// resolution has answered.
    pub fn correlation_area_px(&self) -> f32 {
        let squares: f32 = self.window_weights().iter().map(|w| w * w).sum();
        1.0 / (squares * squares)
    }
}
