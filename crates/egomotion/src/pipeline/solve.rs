//! One frame pair's observations to φ: the only place where the method is chosen.

use super::config::{Approach, Config, EstimatorKind, Method};
use crate::constrain::{binocular_flow, dcce, image_flow};
use crate::estimate::alignment::{Fitting, Form, PointPair, align};
use crate::estimate::likelihood::maximum_likelihood::{MaximumLikelihood, maximum_likelihood};
use crate::estimate::linear::errors_in_variables::errors_in_variables;
use crate::estimate::linear::least_squares::{Weighting, least_squares};
use crate::estimate::linear::lmeds::{LmedsOptions, lmeds};
use crate::estimate::linear::m_estimator::m_estimate;
use crate::estimate::linear::two_step::two_step;
use crate::estimate::measurement::Measurement;
use crate::estimate::sensor::augmented::augmented_step;
use crate::estimate::sensor::tolerance::{SensedTrack, SensorErrors, SensorPrior, TrackSource};
use crate::estimate::{Blocks, Fit, MotionEstimate, Row, Tolerance, Unsolvable};
use crate::geometry::{StereoRig, Twist};
use crate::observe::{DensePair, DepthChange, StereoFlow, StereoTrack};
use nalgebra::Matrix6;

/// Where the observations of a frame pair come from.
#[derive(Debug, Clone, Copy)]
pub enum Observed<'a> {
    /// Tracked corners, and what saw them.
    Sparse(&'a [StereoTrack], TrackSource),
    /// Dense fields, of which every `sample_step_px`-th pixel is used.
    Dense(DensePair<'a>, &'a [StereoTrack]),
}

/// φ over `dt_s` seconds by the configured method; rows and robust weights start from `start`.
///
/// # Errors
/// [`Unsolvable`] when the observations do not determine a motion.
pub fn solve(
    observed: &Observed<'_>,
    rig: &StereoRig,
    start: &Twist,
    config: &Config,
    dt_s: f64,
) -> Result<MotionEstimate, Unsolvable> {
    let solver = Solver::new(rig, start, config).over(dt_s);
    let found = match (config.method, config.approach) {
        (Method::Ml, Approach::Discrete) => solver.sensed(&solver.tracks(observed), observed.source()),
        (Method::Ml, Approach::Differential) => solver.likelihood(&solver.flows(observed)),
        (Method::Dcce, _) => solver.depth_change(&solver.depth_changes(observed)),
        (Method::Dv, _) => solver.binocular(&solver.flows(observed)),
        (Method::Joint, _) => solver.joint(&solver.flows(observed)),
        (Method::Rigid, _) => solver.alignment(&solver.tracks(observed), Form::Rigid),
        (Method::Linear22, _) => solver.alignment(&solver.tracks(observed), Form::Affine),
    };
    found?.known()
}

impl Observed<'_> {
    /// What made the tracks.
    fn source(&self) -> TrackSource {
        match self {
            Observed::Sparse(_, source) => *source,
            Observed::Dense(pair, _) if pair.external_disparity => TrackSource::Image,
            Observed::Dense(..) => TrackSource::Stereo,
        }
    }
}

/// The sensor's errors are looked at again so often at most,
const ROUNDS: usize = 5;
/// until φ moves by less than this, in its standard deviations.
pub(super) const SETTLED: f64 = 0.1;

/// The methods on observations at hand, each with the configured estimator.
#[derive(Debug, Clone, Copy)]
pub struct Solver<'a> {
    rig: &'a StereoRig,
    start: &'a Twist,
    config: &'a Config,
    blocks: Blocks,
    prior: SensorPrior,
}

impl<'a> Solver<'a> {
    /// Rows get their σ, and iterations their start, at the motion `start`.
    pub fn new(rig: &'a StereoRig, start: &'a Twist, config: &'a Config) -> Self {
        let exact = Tolerance::default().over(0.0);
        Self { rig, start, config, blocks: Blocks::over(rig, config.block_px), prior: exact }
    }

    /// The same for an interval of `dt_s` seconds, with the tolerance of the sensor.
    pub fn over(self, dt_s: f64) -> Self {
        Self { prior: self.config.tolerance.over(dt_s), ..self }
    }

    fn tracks(&self, observed: &Observed<'_>) -> Vec<StereoTrack> {
        match observed {
            Observed::Sparse(tracks, _) => tracks.to_vec(),
            Observed::Dense(pair, tracks) => {
                let mut all = pair.every(self.config.sample_step_px, DensePair::stereo_track);
                all.extend_from_slice(tracks);
                all
            }
        }
    }

    fn flows(&self, observed: &Observed<'_>) -> Vec<StereoFlow> {
        let discrete = self.config.approach == Approach::Discrete;
        match observed {
            Observed::Dense(pair, _) if !discrete => {
                pair.every(self.config.sample_step_px, DensePair::stereo_flow)
            }
            _ if discrete => self.tracks(observed).iter().map(StereoTrack::discrete_flow).collect(),
            _ => self.tracks(observed).iter().map(StereoTrack::midpoint_flow).collect(),
        }
    }

    fn depth_changes(&self, observed: &Observed<'_>) -> Vec<DepthChange> {
        let bf = self.rig.depth_disparity_product();
        let step = self.config.sample_step_px;
        match (observed, self.config.approach) {
            (Observed::Sparse(..), _) => Vec::new(),
            (Observed::Dense(pair, _), Approach::Discrete) => {
                pair.every(step, |pair, u, v| Some(pair.depth_track(u, v)?.depth_change(bf)))
            }
            (Observed::Dense(pair, _), Approach::Differential) => {
                pair.every(step, |pair, u, v| Some(pair.depth_flow(u, v)?.depth_change(bf)))
            }
        }
    }

    /// The configured estimator on rows whose scale is as printed.
    fn fit<const N: usize>(&self, rows: &[Row<N>]) -> Result<Fit<N>, Unsolvable> {
        match self.config.estimator {
            EstimatorKind::Ls => least_squares(rows, Weighting::Unit),
            EstimatorKind::Lmeds => lmeds(rows, Weighting::Unit, &self.lmeds()),
            // Noise in the regressors is that of observations, which rows alone do not tell; `Config::check` refuses it.
            EstimatorKind::Irls | EstimatorKind::Eiv => {
                let start = least_squares(rows, Weighting::InverseVariance)?.theta;
                m_estimate(rows, &start, &self.config.irls)
            }
        }
    }

    fn lmeds(&self) -> LmedsOptions {
        LmedsOptions { seed: self.config.lmeds.seed ^ self.config.seed, ..self.config.lmeds }
    }

    /// Maximum likelihood, its covariance with the part that all matches share.
    ///
    /// # Errors
    /// [`Unsolvable`] when the observations do not determine a motion.
    pub fn likelihood<M: Measurement>(&self, observations: &[M]) -> Result<MotionEstimate, Unsolvable> {
        let options = &self.config.maximum_likelihood;
        let blocks = Some(&self.blocks);
        let found = maximum_likelihood(observations, self.rig, self.start, blocks, &options.kernel)?;
        let mut motion = found.motion;
        motion.theta.cov += self.phase(&found);
        Ok(motion)
    }

    /// What the phase error adds to a covariance.
    fn phase(&self, found: &MaximumLikelihood) -> Matrix6<f64> {
        let known = found.motion.theta.cov.iter().all(|v| v.is_finite());
        let sigma_px = self.config.maximum_likelihood.phase_error_px;
        let common = found.common.filter(|_| known);
        common.map_or_else(Matrix6::zeros, |common| common.phase_covariance(sigma_px))
    }

    /// Maximum likelihood of tracks that a sensor made which is known only so well.
    fn sensed(&self, tracks: &[StereoTrack], source: TrackSource) -> Result<MotionEstimate, Unsolvable> {
        if self.prior.is_exact() {
            return self.likelihood(tracks);
        }
        let (mut errors, mut start) = (SensorErrors::none(), *self.start);
        let mut round = 0;
        loop {
            let made = tracks.iter().map(|&track| SensedTrack { track, source });
            let corrected: Vec<SensedTrack> =
                made.map(|sensed| errors.corrected(&sensed, self.rig)).collect();
            let found = Solver { start: &start, ..*self }.round(&corrected, &mut errors)?;
            let moved = found.moved_from(&start);
            start = found.phi();
            round += 1;
            if moved < SETTLED || round == ROUNDS {
                return Ok(found);
            }
        }
    }

    /// Maximum likelihood of observations from which `errors` are taken, and a step towards the most likely errors.
    pub(super) fn round(
        &self,
        corrected: &[SensedTrack],
        errors: &mut SensorErrors,
    ) -> Result<MotionEstimate, Unsolvable> {
        let tracks: Vec<StereoTrack> = corrected.iter().map(|sensed| sensed.track).collect();
        let kernel = &self.config.maximum_likelihood.kernel;
        let blocks = &self.blocks;
        let found = maximum_likelihood(&tracks, self.rig, self.start, Some(blocks), kernel)?;
        let (phase, mut motion) = (self.phase(&found), found.motion);
        let joint = match self.prior.is_exact() {
            true => None,
            false => augmented_step(corrected, self.rig, &found, errors, &self.prior, blocks),
        };
        if let Some(joint) = joint {
            motion.theta.mean += joint.step;
            motion.theta.cov = joint.cov;
            *errors = joint.errors;
        }
        motion.theta.cov += phase;
        Ok(motion)
    }

    /// DCCE, (12).
    ///
    /// # Errors
    /// [`Unsolvable`] when the observations do not determine a motion.
    pub fn depth_change(&self, changes: &[DepthChange]) -> Result<MotionEstimate, Unsolvable> {
        if self.config.estimator == EstimatorKind::Eiv {
            return errors_in_variables(changes, self.rig, self.start, &self.blocks);
        }
        let rows: Vec<Row<6>> = changes
            .iter()
            .map(|change| {
                let constraint = dcce::constraint(change, self.rig.focal_px, self.start);
                Row::from_constraint(&constraint, self.blocks.index(change.x_px, change.y_px))
            })
            .collect();
        Ok(self.fit(&rows)?.estimate(&rows))
    }

    fn flow_rows(&self, flows: &[StereoFlow]) -> Vec<Row<6>> {
        flows
            .iter()
            .flat_map(|flow| {
                let block = self.blocks.index(flow.x_px, flow.y_px);
                image_flow::constraints(flow, self.rig, self.start).map(|c| Row::from_constraint(&c, block))
            })
            .collect()
    }

    /// Binocular flow in two steps, (14) then (3).
    ///
    /// # Errors
    /// [`Unsolvable`] when the observations do not determine a motion.
    pub fn binocular(&self, flows: &[StereoFlow]) -> Result<MotionEstimate, Unsolvable> {
        let dv: Vec<Row<6>> = flows
            .iter()
            .map(|flow| {
                let constraint = binocular_flow::constraint_as_printed(flow, self.rig, self.start);
                Row::from_constraint(&constraint, self.blocks.index(flow.x_px, flow.y_px))
            })
            .collect();
        two_step(&dv, &self.flow_rows(flows), |rows| self.fit(rows))
    }

    /// Binocular flow and image flow at once: rows in metres and in pixels only add up in units of their σ.
    ///
    /// # Errors
    /// [`Unsolvable`] when the observations do not determine a motion.
    pub fn joint(&self, flows: &[StereoFlow]) -> Result<MotionEstimate, Unsolvable> {
        let mut rows = self.flow_rows(flows);
        rows.extend(flows.iter().map(|flow| {
            let constraint = binocular_flow::constraint(flow, self.rig, self.start);
            Row::from_constraint(&constraint, self.blocks.index(flow.x_px, flow.y_px))
        }));
        let fit = match self.config.estimator {
            EstimatorKind::Ls => least_squares(&rows, Weighting::InverseVariance)?,
            EstimatorKind::Lmeds => lmeds(&rows, Weighting::InverseVariance, &self.lmeds())?,
            EstimatorKind::Irls | EstimatorKind::Eiv => {
                m_estimate(&rows, &self.start.vector(), &self.config.irls)?
            }
        };
        Ok(fit.estimate(&rows))
    }

    /// Point pairs, (22), with a rotation or any matrix.
    ///
    /// # Errors
    /// [`Unsolvable`] when the pairs do not determine a motion.
    pub fn alignment(&self, tracks: &[StereoTrack], form: Form) -> Result<MotionEstimate, Unsolvable> {
        let pairs: Vec<PointPair> = tracks
            .iter()
            .filter_map(|track| {
                let block = self.blocks.index(track.before.mean.x, track.before.mean.y);
                PointPair::from_track(track, self.rig, block)
            })
            .collect();
        let fitting = match self.config.estimator {
            EstimatorKind::Ls => Fitting::LeastSquares,
            EstimatorKind::Lmeds => Fitting::Lmeds(self.lmeds()),
            EstimatorKind::Irls | EstimatorKind::Eiv => Fitting::MEstimator(self.config.irls),
        };
        align(&pairs, form, &fitting)
    }
}
