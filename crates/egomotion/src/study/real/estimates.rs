//! φ by every method of the paper from one measured triple, and the best estimator's from its images.

use crate::constrain::{binocular_flow, dcce, image_flow};
use crate::estimate::alignment::{Fitting, Form, PointPair, align};
use crate::estimate::least_squares::{Weighting, least_squares};
use crate::estimate::lmeds::{LmedsOptions, lmeds};
use crate::estimate::two_step::two_step;
use crate::estimate::{Blocks, Fit, MotionEstimate, Row, Unsolvable};
use crate::geometry::{StereoRig, Twist};
use crate::observe::{DensePair, DepthChange, StereoFlow, StereoTrack};
use crate::pipeline::stereo::PipelineError;
use crate::pipeline::{Approach, Config, FrameMotion, Method, StereoFrame, StereoMotion};
use crate::sim::StereoImages;

use super::measured::Measured;
use super::way::{Estimator, Way};

/// φ of the left camera by the paper's methods, each from every `step_px`-th pixel where it measures, least squares
/// and least median of squares; no pixel is chosen with the help of the truth.
///
/// A way that finds no motion is left out.
pub fn printed_ways(measured: &Measured, step_px: usize, seed: u64) -> Vec<(Way, MotionEstimate)> {
    let solver =
        Solver { rig: &measured.rig, blocks: Blocks::over(&measured.rig, Config::default().block_px), seed };
    let bf = measured.rig.depth_disparity_product();
    let pair = measured.pair();
    let tracks = pair.every(step_px, DensePair::stereo_track);
    let changes: [Vec<DepthChange>; 2] = [
        pair.every(step_px, |_, u, v| Some(measured.depth_flow(u, v)?.depth_change(bf))),
        pair.every(step_px, |pair, u, v| Some(pair.depth_track(u, v)?.depth_change(bf))),
    ];
    let flows: [Vec<StereoFlow>; 2] = [
        pair.every(step_px, |_, u, v| measured.stereo_flow(u, v)),
        tracks.iter().map(StereoTrack::discrete_flow).collect(),
    ];
    let mut found = Vec::new();
    let mut add = |approach, method, estimator, answer: Result<MotionEstimate, Unsolvable>| {
        let known = answer.and_then(MotionEstimate::known);
        found.extend(known.ok().map(|estimate| (Way::new(approach, method, estimator), estimate)));
    };
    for estimator in [Estimator::Ls, Estimator::Lmeds] {
        for (i, approach) in [Approach::Differential, Approach::Discrete].into_iter().enumerate() {
            add(approach, Method::Dcce, estimator, solver.dcce(&changes[i], estimator));
            add(approach, Method::Dv, estimator, solver.dv(&flows[i], estimator));
        }
        for (method, form) in [(Method::Linear22, Form::Affine), (Method::Rigid, Form::Rigid)] {
            add(Approach::Discrete, method, estimator, solver.align(&tracks, form, estimator));
        }
    }
    found
}

/// The pipeline's answer for two frames with all its defaults: maximum likelihood, φ and the map of VZ.
///
/// # Errors
/// [`PipelineError`] when the rig cannot measure.
pub fn best(
    before: &StereoImages,
    after: &StereoImages,
    rig: &StereoRig,
) -> Result<FrameMotion, PipelineError> {
    let mut pipeline = StereoMotion::new(*rig, Config::default())?;
    let frame = |images: &StereoImages, time_s: f64| StereoFrame {
        time_s,
        left: images.left.clone(),
        right: images.right.clone(),
    };
    pipeline.push(frame(before, 0.0));
    Ok(pipeline.push(frame(after, 1.0)))
}

struct Solver<'a> {
    rig: &'a StereoRig,
    blocks: Blocks,
    seed: u64,
}

impl Solver<'_> {
    /// The estimator on rows whose scale is as printed.
    fn fit<const N: usize>(&self, rows: &[Row<N>], estimator: Estimator) -> Result<Fit<N>, Unsolvable> {
        match estimator {
            Estimator::Lmeds => lmeds(rows, Weighting::Unit, &self.lmeds()),
            _ => least_squares(rows, Weighting::Unit),
        }
    }

    fn lmeds(&self) -> LmedsOptions {
        LmedsOptions { seed: self.seed, ..LmedsOptions::default() }
    }

    /// (12).
    fn dcce(&self, changes: &[DepthChange], estimator: Estimator) -> Result<MotionEstimate, Unsolvable> {
        let row = |change: &DepthChange| {
            let constraint = dcce::constraint(change, self.rig.focal_px, &Twist::zero());
            Row::from_constraint(&constraint, self.blocks.index(change.x_px, change.y_px))
        };
        let rows: Vec<Row<6>> = changes.iter().map(row).collect();
        Ok(self.fit(&rows, estimator)?.estimate(&rows))
    }

    /// (14), then (3).
    fn dv(&self, flows: &[StereoFlow], estimator: Estimator) -> Result<MotionEstimate, Unsolvable> {
        let still = Twist::zero();
        let (mut first, mut second) = (Vec::new(), Vec::new());
        for flow in flows {
            let block = self.blocks.index(flow.x_px, flow.y_px);
            let dv = binocular_flow::constraint_as_printed(flow, self.rig, &still);
            first.push(Row::from_constraint(&dv, block));
            let flow = image_flow::constraints(flow, self.rig, &still);
            second.extend(flow.map(|constraint| Row::from_constraint(&constraint, block)));
        }
        two_step(&first, &second, |rows| self.fit(rows, estimator))
    }

    /// (22).
    fn align(
        &self,
        tracks: &[StereoTrack],
        form: Form,
        estimator: Estimator,
    ) -> Result<MotionEstimate, Unsolvable> {
        let pair = |track: &StereoTrack| {
            let block = self.blocks.index(track.before.mean.x, track.before.mean.y);
            PointPair::from_track(track, self.rig, block)
        };
        let pairs: Vec<PointPair> = tracks.iter().filter_map(pair).collect();
        let fitting = match estimator {
            Estimator::Lmeds => Fitting::Lmeds(self.lmeds()),
            _ => Fitting::LeastSquares,
        };
        align(&pairs, form, &fitting)
    }
}
