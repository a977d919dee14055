//! Measurements of exact points: which are outliers, and noise.

use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::exact_point::ExactPoint;
use super::factors::{Ends, Factors, OutlierKind};
use crate::synthetic::{DifferentialDraw, DiscreteDraw, Draw};
use egomotion::geometry::{Gaussian, StereoRig, Twist};
use egomotion::observe::{DepthFlow, DepthTrack, StereoFlow, StereoTrack};

/// Largest error of a uniform outlier in x, y and d, in pixels: how far a matcher searches.
///
/// Outliers of a smaller reach are harder to tell from noise.
const MISMATCH_REACH_PX: f64 = 16.0;
/// Distance that a moving body goes by itself in one interval, in metres, in a random direction.
///
/// A faster body is easier to tell from the scene.
const BODY_STEP_M: f64 = 0.1;
/// Angle that a moving body turns by itself in one interval about its middle, in radians, about a random axis.
///
/// A body that turns more is easier to tell from the scene.
const BODY_TURN_RAD: f64 = 0.02;

/// Points of one draw: inliers first, then outliers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SampledPoints {
    /// The points.
    pub(super) points: Vec<ExactPoint>,
    /// Number of points at the head of the list that move with the scene.
    pub(super) inliers: usize,
}

fn normals(rng: &mut Pcg64Mcg) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

impl SampledPoints {
    /// The share of outliers that the factors ask for among `points`.
    pub(super) fn new(
        mut points: Vec<ExactPoint>,
        factors: &Factors,
        rig: &StereoRig,
        phi: &Twist,
        rng: &mut Pcg64Mcg,
    ) -> Self {
        let outliers = (factors.outliers * points.len() as f64).round() as usize;
        let inliers = points.len() - outliers.min(points.len());
        if inliers < points.len() {
            match factors.outlier_kind {
                OutlierKind::Uniform => {
                    points[inliers..].iter_mut().for_each(|point| *point = mismatched(point, rng))
                }
                OutlierKind::Coherent => one_body(&mut points, inliers, rig, phi, rng),
            }
        }
        Self { points, inliers }
    }

    /// Exact structures of the inliers.
    pub(super) fn structures(&self) -> Vec<Vector3<f64>> {
        self.points[..self.inliers].iter().map(|point| point.xyd).collect()
    }
}

fn mismatched(point: &ExactPoint, rng: &mut Pcg64Mcg) -> ExactPoint {
    let off = Vector3::from_fn(|_, _| rng.random_range(-MISMATCH_REACH_PX..MISMATCH_REACH_PX));
    point.carried(point.later + off, point.rate + off)
}

/// All but `inliers` of the points, those nearest to one of them in the image, move as one body.
fn one_body(points: &mut [ExactPoint], inliers: usize, rig: &StereoRig, phi: &Twist, rng: &mut Pcg64Mcg) {
    let middle = points[rng.random_range(0..points.len())].xyd;
    let distance = |point: &ExactPoint| (point.xyd - middle).xy().norm_squared();
    points.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
    let body = &mut points[inliers..];
    let points = body.iter().filter_map(|point| rig.point(&point.xyd));
    let centre = points.sum::<Vector3<f64>>() / body.len() as f64;
    let omega = normals(rng).normalize() * BODY_TURN_RAD;
    let own = Twist { t: normals(rng).normalize() * BODY_STEP_M - omega.cross(&centre), omega };
    let motion = phi.exp().after(&own.exp());
    let together = phi.vector() + own.vector();
    for point in body {
        let later = rig.point(&point.xyd).and_then(|p| rig.project(&motion.apply(&p)));
        let rate = rig.velocity_jacobian(&point.xyd) * together;
        *point = point.carried(later.unwrap_or(point.later), rate);
    }
}

/// Tracks with noise of the same σ on x, y and d at both ends, or none on (x, y) at t.
pub(super) fn discrete(
    points: &[ExactPoint],
    factors: &Factors,
    rng: &mut Pcg64Mcg,
) -> DiscreteDraw<'static> {
    let sigma = factors.noise_px;
    let variance = sigma * sigma;
    let place = match factors.ends {
        Ends::Both => variance,
        Ends::Later => 0.0,
    };
    let before_sigma = Vector3::new(place.sqrt(), place.sqrt(), sigma);
    let mut draw = Draw::at(Vec::new());
    for point in points {
        let before = point.xyd + normals(rng).component_mul(&before_sigma);
        let after = point.later + normals(rng) * sigma;
        // At the same place of the later image: its disparity and slope, with noise of their own.
        let here = normals(rng) * sigma;
        let half = std::f64::consts::FRAC_1_SQRT_2;
        draw.changes.push(DepthTrack {
            x_px: before.x,
            y_px: before.y,
            disparity: Gaussian::independent(
                [
                    before.z,
                    point.later_here + here.x,
                    point.slope_later.x + half * here.y,
                    point.slope_later.y + half * here.z,
                ],
                [variance, variance, 0.5 * variance, 0.5 * variance],
            ),
            displacement: Gaussian::independent((after - before).xy().into(), [variance + place; 2]),
        });
        draw.motions.push(StereoTrack {
            before: Gaussian::independent(before.into(), [place, place, variance]),
            after: Gaussian::independent(after.into(), [variance; 3]),
        });
    }
    draw.complete.clone_from(&draw.motions);
    draw
}

/// Velocities at exact pixels with noise of the same σ on d and on every component of both cameras' flow.
pub(super) fn differential(
    points: &[ExactPoint],
    factors: &Factors,
    rng: &mut Pcg64Mcg,
) -> DifferentialDraw<'static> {
    let sigma = factors.noise_px;
    let variance = sigma * sigma;
    let mut draw = Draw::at(Vec::new());
    for point in points {
        let [x_px, y_px, d] = point.xyd.into();
        let noise = normals(rng) * sigma;
        let [vx, vy] = [point.rate.x + noise.x, point.rate.y + noise.y];
        let right: f64 = point.rate.x - point.rate.z + sigma * rng.sample::<f64, _>(StandardNormal);
        let d = d + noise.z;
        let slopes = normals(rng) * (sigma * std::f64::consts::FRAC_1_SQRT_2);
        draw.changes.push(DepthFlow {
            x_px,
            y_px,
            disparity: Gaussian::independent(
                [d, point.slope.x + slopes.x, point.slope.y + slopes.y, point.rate_here + slopes.z],
                [variance, 0.5 * variance, 0.5 * variance, 0.5 * variance],
            ),
            flow: Gaussian::independent([vx, vy], [variance; 2]),
        });
        let measured = Gaussian::independent([d, vx, vy, right], [variance; 4]);
        draw.motions.push(StereoFlow { x_px, y_px, measured });
    }
    draw.complete.clone_from(&draw.motions);
    draw
}
