//! VZ of every pixel by the paper's four methods.

use rayon::prelude::*;

use super::contender::{ImageContender, ImageEstimator};
use super::matching::MatchedFrames;
use egomotion::geometry::Field;
use egomotion::motion::DepthVelocity;
use egomotion::motion::depth_velocity::{dcce, dv, dv_discrete};
use egomotion::observe::GradientStencil;
use egomotion::pipeline::{Approach, FrameMotion, Method};

/// The contenders of finding VZ at a pixel: (7), (9), (17) and (21).
pub(super) const PIXEL_CONTENDERS: [ImageContender; 4] = [
    ImageContender::new(Approach::Differential, Method::Dcce, ImageEstimator::Pixel),
    ImageContender::new(Approach::Differential, Method::Dv, ImageEstimator::Pixel),
    ImageContender::new(Approach::Discrete, Method::Dcce, ImageEstimator::Pixel),
    ImageContender::new(Approach::Discrete, Method::Dv, ImageEstimator::Pixel),
];

/// The maps of [`PIXEL_CONTENDERS`], and that of the pipeline's answer for the same frames.
pub(super) fn maps(matched: &MatchedFrames, pipeline: &FrameMotion) -> Vec<(ImageContender, Field)> {
    let best =
        pipeline.dense.as_ref().map(|dense| (ImageContender::BEST, dense.motion.depth_velocity.clone()));
    PIXEL_CONTENDERS.map(|contender| (contender, map(matched, contender))).into_iter().chain(best).collect()
}

/// VZ in metres per frame, on the pixel grid of t; missing where something it needs was not matched.
///
/// A contender that is not one of [`PIXEL_CONTENDERS`] gives a map without any value.
fn map(matched: &MatchedFrames, contender: ImageContender) -> Field {
    let bf = matched.rig.depth_disparity_product();
    let pair = matched.pair();
    let at = |u: usize, v: usize| -> Option<DepthVelocity> {
        match (contender.method, contender.approach) {
            (Method::Dcce, Approach::Differential) => Some(dcce(&matched.depth_flow(u, v)?.depth_change(bf))),
            (Method::Dv, Approach::Differential) => Some(dv(&matched.stereo_flow(u, v)?, bf)),
            (Method::Dcce, Approach::Discrete) => {
                Some(dcce(&pair.depth_track(u, v, GradientStencil::CentralDifference)?.depth_change(bf)))
            }
            (Method::Dv, Approach::Discrete) => Some(dv_discrete(&pair.stereo_track(u, v)?, bf)),
            _ => None,
        }
    };
    let (width, height) = matched.flow.size();
    let row = |v: usize| -> Vec<Option<f32>> {
        (0..width).map(|u| at(u, v).map(|velocity| velocity.vz().value() as f32)).collect()
    };
    let rows: Vec<Vec<Option<f32>>> = (0..height).into_par_iter().map(row).collect();
    let mut map = Field::missing(width, height);
    for (v, row) in rows.into_iter().enumerate() {
        row.into_iter().enumerate().for_each(|(u, value)| map.set(u, v, value));
    }
    map
}
