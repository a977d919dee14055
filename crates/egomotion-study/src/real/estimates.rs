//! φ by every method of the paper from one measured triple, and the best estimator's from its images.

use egomotion::estimate::alignment::Form;
use egomotion::estimate::{MotionEstimate, Unsolvable};
use egomotion::geometry::{StereoRig, Twist};
use egomotion::observe::{DensePair, DepthChange, StereoFlow, StereoTrack};
use egomotion::pipeline::solve::Solver;
use egomotion::pipeline::stereo::PipelineError;
use egomotion::pipeline::{Approach, Config, EstimatorKind, FrameMotion, Method, StereoFrame, StereoMotion};
use egomotion::sim::StereoImages;

use super::measured::Measured;
use super::way::{Estimator, Way};

/// φ of the left camera by the paper's methods, each from every `step_px`-th pixel where it measures, least squares
/// and least median of squares; no pixel is chosen with the help of the truth.
///
/// A way that finds no motion is left out.
pub fn printed_ways(measured: &Measured, step_px: usize, seed: u64) -> Vec<(Way, MotionEstimate)> {
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
    let estimators = [(Estimator::Ls, EstimatorKind::Ls), (Estimator::Lmeds, EstimatorKind::Lmeds)];
    for (estimator, kind) in estimators {
        let config = Config { estimator: kind, seed, ..Config::default() };
        let still = Twist::zero();
        let solver = Solver::new(&measured.rig, &still, &config);
        let mut add = |approach, method, answer: Result<MotionEstimate, Unsolvable>| {
            let known = answer.and_then(MotionEstimate::with_unbounded_unobserved);
            found.extend(known.ok().map(|estimate| (Way::new(approach, method, estimator), estimate)));
        };
        for (i, approach) in [Approach::Differential, Approach::Discrete].into_iter().enumerate() {
            add(approach, Method::Dcce, solver.depth_change(&changes[i]));
            add(approach, Method::Dv, solver.binocular(&flows[i]));
        }
        add(Approach::Discrete, Method::Linear22, solver.alignment(&tracks, Form::Affine));
        add(Approach::Discrete, Method::Rigid, solver.alignment(&tracks, Form::Rigid));
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
