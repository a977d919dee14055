//! Every choice and every default, once.

use documented::DocumentedFields;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::estimate::{LmedsOptions, MaximumLikelihoodOptions, RigPrior, StudentT, Tolerance};
use crate::geometry::RigError;
use crate::motion::Vehicle;
use crate::observe::disparity::DisparityExpert;
use crate::observe::flow::FlowError;
use crate::observe::{DisparityOptions, FlowOptions, TrackOptions};

/// Which equations determine φ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Maximum likelihood in the measured (x, y, d) at both times.
    Ml,
    /// Depth change constraint, (11).
    Dcce,
    /// Binocular flow in the paper's two steps, (14) then (3).
    Dv,
    /// Binocular flow and image flow solved together.
    Joint,
    /// Point pairs with a rotation, (22) constrained.
    Rigid,
    /// Point pairs with any matrix, (22) as a linear regression.
    Linear22,
}

/// Velocities or finite motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Approach {
    /// Finite displacements between two frames.
    Discrete,
    /// Velocities and derivatives, taken at the middle of the interval.
    Differential,
}

/// How equations are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EstimatorKind {
    /// Least squares, all rows alike, as in the paper.
    Ls,
    /// Least median of squares.
    Lmeds,
    /// Iteratively reweighted least squares, rows weighted by their own variance.
    Irls,
    /// Errors in variables: rows in disparity, all alike, without the bias that noisy gradients bring; for `dcce` alone.
    Eiv,
}

/// What is measured in the images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Observe {
    /// Disparity and flow of every pixel, with all maps.
    Dense,
    /// Tracked corners alone: no maps, the highest rate.
    Sparse,
}

/// Everything that can be chosen in a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Which equations determine φ.
    pub method: Method,
    /// Velocities or finite motion.
    pub approach: Approach,
    /// How equations are solved.
    pub estimator: EstimatorKind,
    /// What is measured in the images.
    pub observe: Observe,
    /// Seed of every random choice.
    pub seed: u64,
    /// Side of the blocks of pixels that count as independent in covariances, in pixels.
    pub block_px: f64,
    /// Dense observations are taken from every n-th pixel in both directions.
    pub sample_step_px: usize,
    /// How well the sensor is known, for method `ml`; all zero: a depth camera's is that of its kind, a stereo rig is exact.
    pub tolerance: Tolerance,
    /// What is known of the errors of a stereo rig.
    pub rig_errors: RigPrior,
    /// What the vehicle sweeps.
    pub vehicle: Vehicle,
    /// Corners and their tracks.
    pub tracks: TrackOptions,
    /// Dense disparity.
    pub disparity: DisparityOptions,
    /// Dense flow.
    pub flow: FlowOptions,
    /// Robust weights of the linear methods with `irls`.
    pub irls: StudentT,
    /// Least median of squares.
    pub lmeds: LmedsOptions,
    /// Maximum likelihood.
    pub maximum_likelihood: MaximumLikelihoodOptions,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            method: Method::Ml,
            approach: Approach::Discrete,
            estimator: EstimatorKind::Irls,
            observe: Observe::Dense,
            seed: 1,
            block_px: 48.0,
            sample_step_px: 3,
            tolerance: Tolerance::default(),
            rig_errors: RigPrior::default(),
            vehicle: Vehicle::default(),
            tracks: TrackOptions::default(),
            disparity: DisparityOptions::default(),
            flow: FlowOptions::default(),
            irls: StudentT::default(),
            lmeds: LmedsOptions::default(),
            maximum_likelihood: MaximumLikelihoodOptions::default(),
        }
    }
}

/// The meaning of a setting by its path, as `["flow", "fill"]`: its documentation.
pub fn meaning(path: &[&str]) -> Option<&'static str> {
    fn of<T: DocumentedFields>(name: &str) -> Option<&'static str> {
        T::get_field_docs(name).ok()
    }
    match path {
        [name] => of::<Config>(name),
        ["tolerance", name] => of::<Tolerance>(name),
        ["rig_errors", name] => of::<RigPrior>(name),
        ["vehicle", name] => of::<Vehicle>(name),
        ["tracks", name] => of::<TrackOptions>(name),
        ["disparity", name] => of::<DisparityOptions>(name),
        ["disparity", "expert", name] => of::<DisparityExpert>(name),
        ["flow", name] => of::<FlowOptions>(name),
        ["irls", name] | ["maximum_likelihood", "kernel", name] => of::<StudentT>(name),
        ["lmeds", name] => of::<LmedsOptions>(name),
        ["maximum_likelihood", name] => of::<MaximumLikelihoodOptions>(name),
        _ => None,
    }
}

/// Why a combination of choices has no meaning.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ConfigError {
    /// Maximum likelihood has its own robust weights.
    #[error(
        "method ml weighs its observations robustly itself: use estimator irls (the default), not ls or lmeds"
    )]
    MaximumLikelihoodEstimator,
    /// Only the depth change constraint has measured gradients among its regressors.
    #[error(
        "estimator eiv corrects for the noisy gradients of method dcce, which no other method has: use method dcce, or estimator irls (the default)"
    )]
    ErrorsInVariablesMethod,
    /// Alignment needs points before and after.
    #[error(
        "methods rigid and linear22 align points before and after: use approach discrete (the default), not differential"
    )]
    AlignmentApproach,
    /// Tracks carry no gradient of disparity.
    #[error(
        "method dcce needs the gradient of disparity, which tracks do not have: use observe dense (the default), not sparse"
    )]
    SparseDepthChange,
    /// A number lies outside its range.
    #[error("{0}")]
    Range(&'static str),
    /// A setting of the dense flow lies outside its range.
    #[error(transparent)]
    Flow(#[from] FlowError),
}

/// Why a pipeline cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PipelineError {
    /// The rig cannot measure.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The choices do not fit together.
    #[error(transparent)]
    Config(#[from] ConfigError),
}

impl Config {
    /// The options of maximum likelihood with the seed of the whole configuration mixed in.
    pub(super) fn seeded_likelihood(&self) -> MaximumLikelihoodOptions {
        let own = &self.maximum_likelihood;
        MaximumLikelihoodOptions { seed: own.seed ^ self.seed, ..*own }
    }

    /// Whether the choices fit together.
    ///
    /// # Errors
    /// [`ConfigError`] gives the reason.
    pub fn check(&self) -> Result<(), ConfigError> {
        if self.method == Method::Ml && self.estimator != EstimatorKind::Irls {
            return Err(match self.estimator {
                EstimatorKind::Eiv => ConfigError::ErrorsInVariablesMethod,
                _ => ConfigError::MaximumLikelihoodEstimator,
            });
        }
        if self.method != Method::Dcce && self.estimator == EstimatorKind::Eiv {
            return Err(ConfigError::ErrorsInVariablesMethod);
        }
        let alignment = matches!(self.method, Method::Rigid | Method::Linear22);
        if alignment && self.approach == Approach::Differential {
            return Err(ConfigError::AlignmentApproach);
        }
        if self.method == Method::Dcce && self.observe == Observe::Sparse {
            return Err(ConfigError::SparseDepthChange);
        }
        self.check_ranges()?;
        self.flow.check()?;
        Ok(())
    }

    fn check_ranges(&self) -> Result<(), ConfigError> {
        let ml = &self.maximum_likelihood;
        let kernels = [&self.irls, &ml.kernel];
        // Beyond these the number of subsets (59) runs into the millions.
        let searchable = |confidence: f64, outliers: f64| {
            (0.0..=0.9999).contains(&confidence) && (0.0..=0.7).contains(&outliers)
        };
        let rules = [
            (self.block_px.is_finite() && self.block_px >= 4.0, "block_px must be at least 4"),
            (self.sample_step_px >= 1, "sample_step_px must be at least 1"),
            (self.tracks.corners >= 1, "tracks.corners must be at least 1"),
            (self.tracks.iterations >= 1, "tracks.iterations must be at least 1"),
            (self.tracks.back_tolerance_px > 0.0, "tracks.back_tolerance_px must be positive"),
            (self.tracks.largest_residual > 0.0, "tracks.largest_residual must be positive"),
            (self.disparity.levels >= 1, "disparity.levels must be at least 1"),
            (kernels.iter().all(|k| k.nu > 0.0 && k.nu.is_finite()), "nu must be positive and finite"),
            (kernels.iter().all(|k| k.iterations >= 1), "iterations must be at least 1"),
            (kernels.iter().all(|k| k.tolerance > 0.0), "tolerance must be positive"),
            (
                searchable(self.lmeds.confidence, self.lmeds.outliers),
                "lmeds.confidence must be 0 to 0.9999, lmeds.outliers 0 to 0.7",
            ),
            (self.lmeds.cut > 0.0, "lmeds.cut must be positive"),
            (
                searchable(ml.confidence, ml.outliers),
                "maximum_likelihood.confidence must be 0 to 0.9999, maximum_likelihood.outliers 0 to 0.7",
            ),
            (ml.start_observations >= 4, "maximum_likelihood.start_observations must be at least 4"),
            (
                ml.phase_error_px.is_finite() && ml.phase_error_px >= 0.0,
                "maximum_likelihood.phase_error_px must not be negative",
            ),
            (
                ml.field_error_px.is_finite() && ml.field_error_px >= 0.0,
                "maximum_likelihood.field_error_px must not be negative",
            ),
            (self.tolerance.is_valid(), "tolerance: each must be finite and not negative"),
            (self.rig_errors.is_valid(), "rig_errors: each must be finite, and no sigma negative"),
            (
                self.vehicle.left_m < self.vehicle.right_m && self.vehicle.top_m < self.vehicle.bottom_m,
                "vehicle: left_m must be less than right_m, top_m less than bottom_m",
            ),
        ];
        rules.iter().find(|(ok, _)| !ok).map_or(Ok(()), |(_, rule)| Err(ConfigError::Range(rule)))
    }
}
