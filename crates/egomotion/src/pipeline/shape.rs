//! φ where depth is measured for itself: flow and corners where there is texture, shape everywhere else.
//!
//! Depth and grey levels come from two sensors that never see quite the same moment, and blur and rolling shutters
//! spoil one more than the other. How far each is from what it claims is seen in its own residuals, and each is
//! weighed by that: places by where points are found off the motion's prediction, disparities by what the later map
//! says there. Windows of flow overlap, so that a pixel's place tells little beside its neighbours': against shape,
//! which does not overlap as much, it counts by the area over which its error is the same.

use nalgebra::{Matrix2, Vector2};

use super::config::Config;
use super::solve::Solver;
use crate::estimate::{MotionEstimate, Unsolvable, median};
use crate::geometry::{RigidMotion, StereoRig, Twist};
use crate::observe::{DensePair, StereoTrack};

/// Most times that the shape is looked at again from where the last motion leads.
const ROUNDS: usize = 10;
/// Shape is settled when φ moves by less than this, in its standard deviations.
const SETTLED: f64 = 0.1;
/// Disparities further from the prediction than this are of another surface, in pixels: at first without any motion
/// to start from, and in the end.
const OTHER_SURFACE_PX: (f64, f64) = (8.0, 1.0);
/// Medians of χ² with one and with two degrees of freedom.
const MEDIAN_1: f64 = 0.455;
const MEDIAN_2: f64 = 1.386;
/// A source's variance is corrected by at most this factor either way.
const LARGEST_FACTOR: f64 = 100.0;

/// φ by maximum likelihood from what is `tracked` (corners) and the fields of a pair whose disparity is given.
///
/// Without a `start` it begins at rest, with a wide look at the shape.
///
/// # Errors
/// [`Unsolvable`] when neither texture nor shape determines a motion.
pub(super) fn solve_with_shape(
    pair: &DensePair<'_>,
    corners: &[StereoTrack],
    start: Option<&Twist>,
    config: &Config,
) -> Result<MotionEstimate, Unsolvable> {
    let tracked = Tracked { flow: pair.every(config.sample_step_px, DensePair::stereo_track), corners };
    let mut phi = start.copied().unwrap_or_else(Twist::zero);
    let mut reach = if start.is_some() { OTHER_SURFACE_PX.1 } else { OTHER_SURFACE_PX.0 };
    let mut round = 0;
    loop {
        let motion = phi.exp();
        let all = observations(pair, &tracked, &motion, reach, config);
        let found = Solver::new(pair.rig, &phi, config).likelihood(&all)?;
        let step = found.phi().vector() - phi.vector();
        let moved = (0..6).map(|i| (step[i] / found.theta.sigma(i)).abs()).fold(0.0, f64::max);
        phi = found.phi();
        round += 1;
        let near = reach <= OTHER_SURFACE_PX.1;
        if (near && moved.is_finite() && moved < SETTLED) || round == ROUNDS {
            return Ok(found);
        }
        reach = (0.5 * reach).max(OTHER_SURFACE_PX.1);
    }
}

/// Points whose places were found in both images.
struct Tracked<'a> {
    flow: Vec<StereoTrack>,
    corners: &'a [StereoTrack],
}

/// Everything that is known about a motion near the given one, each source with the noise that it shows.
fn observations(
    pair: &DensePair<'_>,
    tracked: &Tracked<'_>,
    motion: &RigidMotion,
    reach_px: f64,
    config: &Config,
) -> Vec<StereoTrack> {
    let shapes = pair.every(config.sample_step_px, |pair, u, v| {
        let track = pair.shape_track(u, v, motion, reach_px)?;
        Some((track, pair.flow.get(u, v).is_some()))
    });
    let squares = shapes.iter().filter_map(|(track, _)| across_surface(track, pair.rig, motion));
    let disparity = factor(squares.collect(), MEDIAN_1);
    let place = |tracks: &[StereoTrack]| {
        let squares = tracks.iter().filter_map(|track| along_surface(track, pair.rig, motion));
        factor(squares.collect(), MEDIAN_2)
    };
    let (by_flow, by_corners) = (place(&tracked.flow) * overlap(config), place(tracked.corners));
    let flow = tracked.flow.iter().map(|track| scaled(track, by_flow, disparity));
    let corners = tracked.corners.iter().map(|track| scaled(track, by_corners, disparity));
    let elsewhere = shapes.iter().filter(|(_, tracked)| !tracked);
    flow.chain(corners).chain(elsewhere.map(|(track, _)| scaled(track, 1.0, disparity))).collect()
}

/// How many of the sampled pixels share the error of one pixel's flow.
fn overlap(config: &Config) -> f64 {
    let step = config.sample_step_px as f64;
    (f64::from(config.flow.correlation_area_px()) / (step * step)).max(1.0)
}

/// By how much variances are larger than stated.
fn factor(mut squares: Vec<f64>, expected: f64) -> f64 {
    let factor = median(&mut squares) / expected;
    if factor.is_finite() { factor.clamp(LARGEST_FACTOR.recip(), LARGEST_FACTOR) } else { 1.0 }
}

/// The squared misfit of disparity alone, the place taken as known from the motion, over its variance.
fn across_surface(track: &StereoTrack, rig: &StereoRig, motion: &RigidMotion) -> Option<f64> {
    let led = rig.project(&motion.apply(&rig.point(&track.before.mean)?))?;
    let (_, slope, own) = parts(track.after.cov)?;
    let misfit = track.after.mean.z - led.z - slope.dot(&(track.after.mean.xy() - led.xy()));
    Some(misfit * misfit / (own + track.before.cov.m33))
}

/// The squared misfit of the place over its covariance.
fn along_surface(track: &StereoTrack, rig: &StereoRig, motion: &RigidMotion) -> Option<f64> {
    let led = rig.project(&motion.apply(&rig.point(&track.before.mean)?))?;
    let place = |cov: &nalgebra::Matrix3<f64>| cov.fixed_view::<2, 2>(0, 0).into_owned();
    let cov = place(&track.before.cov) + place(&track.after.cov);
    let misfit = track.after.mean.xy() - led.xy();
    Some(misfit.dot(&(cov.try_inverse()? * misfit)))
}

/// Covariance of the place, slope by which an error of it moves disparity, and disparity's own variance.
fn parts(cov: nalgebra::Matrix3<f64>) -> Option<(Matrix2<f64>, Vector2<f64>, f64)> {
    let place: Matrix2<f64> = cov.fixed_view::<2, 2>(0, 0).into();
    let cross = Vector2::new(cov.m13, cov.m23);
    let slope = place.try_inverse()? * cross;
    Some((place, slope, cov.m33 - slope.dot(&cross)))
}

/// The same track with the variances of its places and of its disparities multiplied.
fn scaled(track: &StereoTrack, place: f64, disparity: f64) -> StereoTrack {
    let mut track = *track;
    for end in [&mut track.before, &mut track.after] {
        let Some((_, slope, own)) = parts(end.cov) else {
            end.cov.m33 *= disparity;
            continue;
        };
        let cov = &mut end.cov;
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (1, 2), (2, 0), (2, 1)] {
            cov[(i, j)] *= place;
        }
        cov.m33 = own * disparity + slope.x * cov.m13 + slope.y * cov.m23;
    }
    track
}
