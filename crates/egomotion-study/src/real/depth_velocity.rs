//! VZ of every pixel by the paper's four methods.

use rayon::prelude::*;

use super::measured::Measured;
use super::way::{Estimator, Way};
use egomotion::geometry::Field;
use egomotion::motion::DepthVelocity;
use egomotion::motion::depth_velocity::{dcce, dv, dv_discrete};
use egomotion::pipeline::{Approach, FrameMotion, Method};

/// The ways of finding VZ at a pixel: (7), (9), (17) and (21).
pub const WAYS: [Way; 4] = [
    Way::new(Approach::Differential, Method::Dcce, Estimator::Pixel),
    Way::new(Approach::Differential, Method::Dv, Estimator::Pixel),
    Way::new(Approach::Discrete, Method::Dcce, Estimator::Pixel),
    Way::new(Approach::Discrete, Method::Dv, Estimator::Pixel),
];

/// The maps of [`WAYS`], and that of the pipeline's answer for the same frames.
pub fn maps(measured: &Measured, best: &FrameMotion) -> Vec<(Way, Field)> {
    let best = best.dense.as_ref().map(|dense| (Way::BEST, dense.motion.depth_velocity.clone()));
    WAYS.map(|way| (way, map(measured, way))).into_iter().chain(best).collect()
}

/// VZ in metres per frame, on the pixel grid of t; missing where something it needs was not measured.
///
/// A way that is not one of [`WAYS`] gives a map without any value.
pub fn map(measured: &Measured, way: Way) -> Field {
    let bf = measured.rig.depth_disparity_product();
    let pair = measured.pair();
    let at = |u: usize, v: usize| -> Option<DepthVelocity> {
        match (way.method, way.approach) {
            (Method::Dcce, Approach::Differential) => {
                Some(dcce(&measured.depth_flow(u, v)?.depth_change(bf)))
            }
            (Method::Dv, Approach::Differential) => Some(dv(&measured.stereo_flow(u, v)?, bf)),
            (Method::Dcce, Approach::Discrete) => Some(dcce(&pair.depth_track(u, v)?.depth_change(bf))),
            (Method::Dv, Approach::Discrete) => Some(dv_discrete(&pair.stereo_track(u, v)?, bf)),
            _ => None,
        }
    };
    let (width, height) = measured.flow.size();
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
