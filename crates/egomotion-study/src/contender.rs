//! Every method of the paper in both approaches, with each estimator, on one draw.

use serde::{Deserialize, Serialize};

use super::draw::{Differential, Discrete};
use egomotion::estimate::alignment::Form;
use egomotion::estimate::{MaximumLikelihoodOptions, MotionEstimate, Unsolvable};
use egomotion::geometry::{StereoRig, Twist};
use egomotion::pipeline::solve::Solver;
use egomotion::pipeline::{Approach, Config, EstimatorKind, Method};

/// One way to find φ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contender {
    /// Velocities or finite motion.
    pub approach: Approach,
    /// Which equations.
    pub method: Method,
    /// How they are solved; `ml` brings its own.
    pub estimator: EstimatorKind,
}

/// Name of an approach, in files.
pub fn approach_name(approach: Approach) -> &'static str {
    match approach {
        Approach::Discrete => "discrete",
        Approach::Differential => "differential",
    }
}

/// Side of the blocks within which rows are correlated, in pixels.
const STENCIL_BLOCK_PX: f64 = 12.0;

impl Contender {
    /// All that have a meaning in an approach.
    pub fn all(approach: Approach) -> Vec<Self> {
        use {EstimatorKind as E, Method as M};
        let estimators = [E::Ls, E::Lmeds, E::Irls];
        let methods: &[Method] = match approach {
            Approach::Differential => &[M::Dcce, M::Dv, M::Joint],
            Approach::Discrete => &[M::Dcce, M::Dv, M::Joint, M::Linear22, M::Rigid],
        };
        let linear = methods.iter().flat_map(|&method| {
            estimators.into_iter().map(move |estimator| Self { approach, method, estimator })
        });
        let corrected = Self { approach, method: M::Dcce, estimator: E::Eiv };
        linear.chain([corrected]).chain([Self { approach, method: M::Ml, estimator: E::Irls }]).collect()
    }

    /// Name of the method, in files.
    pub fn method_name(&self) -> &'static str {
        match self.method {
            Method::Ml => "ml",
            Method::Dcce => "dcce",
            Method::Dv => "dv",
            Method::Joint => "joint",
            Method::Rigid => "rigid",
            Method::Linear22 => "linear22",
        }
    }

    /// Name of the estimator, in files.
    pub fn estimator_name(&self) -> &'static str {
        match (self.method, self.estimator) {
            (Method::Ml, _) => "ml",
            (_, EstimatorKind::Ls) => "ls",
            (_, EstimatorKind::Lmeds) => "lmeds",
            (_, EstimatorKind::Irls) => "irls",
            (_, EstimatorKind::Eiv) => "eiv",
        }
    }

    /// How it is run in the synthetic world.
    pub fn config(&self, seed: u64) -> Config {
        Config {
            method: self.method,
            approach: self.approach,
            estimator: self.estimator,
            // Pixels share nothing but the stencils of their differences.
            block_px: STENCIL_BLOCK_PX,
            seed,
            // Points of the synthetic world share no error of a matcher.
            maximum_likelihood: MaximumLikelihoodOptions {
                phase_error_px: 0.0,
                ..MaximumLikelihoodOptions::default()
            },
            ..Config::default()
        }
    }

    /// φ of the left camera from velocities, with rows weighted at the motion `start`.
    ///
    /// # Errors
    /// [`Unsolvable`] when the draw does not determine a motion.
    pub fn differential(
        &self,
        draw: &Differential<'_>,
        rig: &StereoRig,
        start: &Twist,
        config: &Config,
    ) -> Result<MotionEstimate, Unsolvable> {
        let solver = Solver::new(rig, start, config);
        match self.method {
            Method::Dcce => {
                let bf = rig.depth_disparity_product();
                let changes: Vec<_> = draw.changes.iter().map(|change| change.depth_change(bf)).collect();
                solver.depth_change(&changes)
            }
            Method::Dv => solver.binocular(&draw.motions),
            Method::Joint => solver.joint(&draw.motions),
            _ => solver.likelihood(&draw.complete),
        }
    }

    /// φ of the left camera from finite displacements, with rows weighted at the motion `start`.
    ///
    /// # Errors
    /// [`Unsolvable`] when the draw does not determine a motion.
    pub fn discrete(
        &self,
        draw: &Discrete<'_>,
        rig: &StereoRig,
        start: &Twist,
        config: &Config,
    ) -> Result<MotionEstimate, Unsolvable> {
        let solver = Solver::new(rig, start, config);
        let flows = || draw.motions.iter().map(|track| track.discrete_flow()).collect::<Vec<_>>();
        match self.method {
            Method::Dcce => {
                let bf = rig.depth_disparity_product();
                let changes: Vec<_> = draw.changes.iter().map(|change| change.depth_change(bf)).collect();
                solver.depth_change(&changes)
            }
            Method::Dv => solver.binocular(&flows()),
            Method::Joint => solver.joint(&flows()),
            Method::Rigid => solver.alignment(&draw.motions, Form::Rigid),
            Method::Linear22 => solver.alignment(&draw.motions, Form::Affine),
            Method::Ml => solver.likelihood(&draw.complete),
        }
    }
}
