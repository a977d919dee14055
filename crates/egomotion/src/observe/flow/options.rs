//! Settings of the dense flow.

use super::{FlowError, search};
use documented::DocumentedFields;
use serde::{Deserialize, Serialize};

/// Settings of [`dense_flow`](super::dense_flow); grey levels are those of 8-bit images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct FlowOptions {
    /// Distance of neighbouring 8×8 patches, 1 … 8 pixels of each level; smaller is slower and denser.
    pub patch_stride_px: usize,
    /// Most iterations of a patch at a level.
    pub search_iterations: usize,
    /// How often a patch tries what its four neighbours found.
    pub propagation_rounds: usize,
    /// Level at which the search ends (0: full resolution) and the refinement begins; its answer there
    /// stands in where full resolution has not enough texture.
    pub finest_search_level: usize,
    /// Whether the initial flow stands in, as a guess, where nothing can be measured.
    pub fill: bool,
    /// Radius of the window of the refinement, 1 … 15 pixels.
    pub window_radius_px: usize,
    /// Iterations of the refinement at full resolution, at least 1; with an initial flow it is always one.
    pub refine_iterations: usize,
    /// Standard deviation of the difference of two grey values when nothing is wrong: least value of
    /// what is estimated locally from the residual.
    pub noise_floor: f32,
    /// Standard deviation added to each component for what the residual does not show (interpolation,
    /// aliasing), in pixels.
    pub sigma_floor_px: f32,
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
    /// Level at which the search of the backward flow ends.
    pub consistency_level: usize,
}

impl Default for FlowOptions {
    fn default() -> Self {
        Self {
            patch_stride_px: 4,
            search_iterations: 12,
            propagation_rounds: 2,
            finest_search_level: 1,
            fill: true,
            window_radius_px: 4,
            refine_iterations: 2,
            noise_floor: 0.7,
            sigma_floor_px: 0.035,
            max_sigma_px: 0.7,
            min_texture: 1.0,
            max_residual: 15.0,
            consistency_px: 1.5,
            consistency_level: 1,
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
            ((1..=search::PATCH).contains(&self.patch_stride_px), "patch_stride_px must be 1 … 8"),
            ((1..=15).contains(&self.window_radius_px), "window_radius_px must be 1 … 15"),
            (self.refine_iterations >= 1, "refine_iterations must be at least 1"),
            (self.noise_floor > 0.0, "noise_floor must be positive"),
            (self.sigma_floor_px >= 0.0, "sigma_floor_px must not be negative"),
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
    /// makes the covariance of the sum too small by about this factor, and by 4 to the power of
    /// `finest_search_level` more where the wider window has answered.
    pub fn correlation_area_px(&self) -> f32 {
        let squares: f32 = self.window_weights().iter().map(|w| w * w).sum();
        1.0 / (squares * squares)
    }
}
