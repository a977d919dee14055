//! φ and VZ by every contender from three stereo frames: the paper's methods, and the library's pipeline.

use serde::Serialize;

use super::RealError;
use super::contender::{ImageContender, ImageEstimator};
use super::depth_velocity;
use super::matching::MatchedFrames;
use crate::synthetic::APPROACHES;
use egomotion::estimate::alignment::Form;
use egomotion::estimate::{MotionEstimate, Unsolvable};
use egomotion::geometry::{Field, StereoRig, Twist};
use egomotion::observe::{DensePair, DepthChange, GradientStencil, StereoFlow, StereoTrack};
use egomotion::pipeline::PipelineError;
use egomotion::pipeline::solve::Solver;
use egomotion::pipeline::{Approach, Config, EstimatorKind, FrameMotion, Method, StereoFrame, StereoMotion};
use egomotion::sim::StereoImages;

/// Settings with which three frames are matched and φ is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct MatchingSettings {
    /// ROUND: levels of disparity in a pixel.
    pub levels: u32,
    /// φ is estimated from every n-th pixel in both directions.
    pub sample_step_px: usize,
    /// Seed of random choices.
    pub seed: u64,
}

/// The answers of all contenders to three stereo frames.
pub(super) struct ImageEstimates {
    pub(super) matched: MatchedFrames,
    /// φ of the left camera, maximum likelihood last; a contender that finds no motion is left out.
    pub(super) motions: Vec<(ImageContender, MotionEstimate)>,
    pipeline: FrameMotion,
}

impl ImageEstimates {
    /// The answers to the frames at t−1, t and t+1.
    pub(super) fn of(
        frames: &[StereoImages; 3],
        rig: &StereoRig,
        settings: &MatchingSettings,
    ) -> Result<Self, RealError> {
        let matched = MatchedFrames::new(frames, rig, settings.levels as f32)?;
        let [_, now, after] = frames;
        let pipeline = by_pipeline(now, after, rig)?;
        let mut motions = by_printed_methods(&matched, settings.sample_step_px, settings.seed);
        motions.extend(pipeline.motion.as_ref().ok().map(|estimate| (ImageContender::BEST, *estimate)));
        Ok(Self { matched, motions, pipeline })
    }

    /// The maps of VZ, in metres per frame.
    pub(super) fn depth_velocities(&self) -> Vec<(ImageContender, Field)> {
        depth_velocity::maps(&self.matched, &self.pipeline)
    }
}

/// φ of the left camera by the paper's methods, each from every `step_px`-th pixel where it is matched, by least squares
/// and least median of squares; no pixel is chosen with the help of the truth.
///
/// A contender that finds no motion is left out.
fn by_printed_methods(
    matched: &MatchedFrames,
    step_px: usize,
    seed: u64,
) -> Vec<(ImageContender, MotionEstimate)> {
    let bf = matched.rig.depth_disparity_product();
    let pair = matched.pair();
    let tracks = pair.every(step_px, DensePair::stereo_track);
    let changes: [Vec<DepthChange>; 2] = [
        pair.every(step_px, |_, u, v| Some(matched.depth_flow(u, v)?.depth_change(bf))),
        pair.every(step_px, |pair, u, v| {
            Some(pair.depth_track(u, v, GradientStencil::CentralDifference)?.depth_change(bf))
        }),
    ];
    let flows: [Vec<StereoFlow>; 2] = [
        pair.every(step_px, |_, u, v| matched.stereo_flow(u, v)),
        tracks.iter().map(StereoTrack::discrete_flow).collect(),
    ];
    let mut found = Vec::new();
    let estimators = [(ImageEstimator::Ls, EstimatorKind::Ls), (ImageEstimator::Lmeds, EstimatorKind::Lmeds)];
    for (estimator, kind) in estimators {
        let config = Config { estimator: kind, seed, ..Config::default() };
        let still = Twist::zero();
        let solver = Solver::new(&matched.rig, &still, &config);
        let mut add = |approach, method, answer: Result<MotionEstimate, Unsolvable>| {
            let known = answer.and_then(MotionEstimate::with_unbounded_unobserved);
            found.extend(
                known.ok().map(|estimate| (ImageContender::new(approach, method, estimator), estimate)),
            );
        };
        for (i, approach) in APPROACHES.into_iter().enumerate() {
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
fn by_pipeline(
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
