//! The estimators of φ under comparison: every method of the paper in both approaches, and maximum likelihood.

use serde::{Deserialize, Serialize};

use super::draw::{DifferentialDraw, DiscreteDraw};
use egomotion::estimate::alignment::Form;
use egomotion::estimate::{MaximumLikelihoodOptions, MotionEstimate, Unsolvable};
use egomotion::geometry::{StereoRig, Twist};
use egomotion::pipeline::solve::Solver;
use egomotion::pipeline::{Approach, Config, EstimatorKind, Method};

/// Both approaches, in the order in which studies run them.
pub(crate) const APPROACHES: [Approach; 2] = [Approach::Differential, Approach::Discrete];

/// Side of the blocks within which the errors of rows count as correlated, in pixels.
///
/// Pixels of the synthetic world share only the disparities of the stencils of their differences, which reach one
/// pixel to each side. Larger blocks leave fewer of them, and so a less certain covariance.
const STENCIL_BLOCK_PX: f64 = 12.0;

/// One estimator of φ under comparison: an approach, a method, and how its equations are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contender {
    /// Differential (velocities) or discrete (finite motion).
    pub approach: Approach,
    /// The method's equations.
    pub method: Method,
    /// How the equations are solved; maximum likelihood has a solver of its own, and ignores this.
    pub estimator: EstimatorKind,
}

/// Name of an approach, in files.
pub(crate) fn approach_name(approach: Approach) -> &'static str {
    match approach {
        Approach::Discrete => "discrete",
        Approach::Differential => "differential",
    }
}

/// Name of a method, in files.
pub(crate) fn method_name(method: Method) -> &'static str {
    match method {
        Method::Ml => "ml",
        Method::Dcce => "dcce",
        Method::Dv => "dv",
        Method::Joint => "joint",
        Method::Rigid => "rigid",
        Method::Linear22 => "linear22",
    }
}

/// Name of a method in tables and legends, the same in all of them.
pub(crate) fn method_label(method: Method) -> &'static str {
    match method {
        Method::Ml => "ML",
        Method::Dcce => "DCCE",
        Method::Dv => "DV",
        Method::Joint => "joint",
        Method::Rigid => "(22) rigid",
        Method::Linear22 => "(22)",
    }
}

/// The paper's short name of an approach, in legends.
pub(crate) fn approach_label(approach: Approach) -> &'static str {
    match approach {
        Approach::Discrete => "DISC",
        Approach::Differential => "DIFF",
    }
}

impl Contender {
    /// All contenders of an approach: each method with each estimator that has a meaning for it.
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

    /// Names of approach, method and estimator, in files.
    pub(crate) fn names(&self) -> [&'static str; 3] {
        [approach_name(self.approach), method_name(self.method), self.estimator_name()]
    }

    fn estimator_name(&self) -> &'static str {
        match (self.method, self.estimator) {
            (Method::Ml, _) => "ml",
            (_, EstimatorKind::Ls) => "ls",
            (_, EstimatorKind::Lmeds) => "lmeds",
            (_, EstimatorKind::Irls) => "irls",
            (_, EstimatorKind::Eiv) => "eiv",
        }
    }

    /// The configuration with which it runs in the synthetic world.
    pub fn config(&self, seed: u64) -> Config {
        Config {
            method: self.method,
            approach: self.approach,
            estimator: self.estimator,
            block_px: STENCIL_BLOCK_PX,
            seed,
            // Points of the synthetic world share no error of a matcher.
            maximum_likelihood: MaximumLikelihoodOptions {
                phase_error_px: 0.0,
                field_error_px: 0.0,
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
        draw: &DifferentialDraw<'_>,
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
            _ => solver.likelihood(&draw.complete).map(|solved| solved.with_exact_rig()),
        }
    }

    /// φ of the left camera from finite displacements, with rows weighted at the motion `start`.
    ///
    /// # Errors
    /// [`Unsolvable`] when the draw does not determine a motion.
    pub fn discrete(
        &self,
        draw: &DiscreteDraw<'_>,
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
            Method::Ml => solver.likelihood(&draw.complete).map(|solved| solved.with_exact_rig()),
        }
    }
}
