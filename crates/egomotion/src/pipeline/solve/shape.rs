//! φ where depth is measured for itself: flow and corners where there is texture, shape everywhere else.
//!
//! Depth and grey levels come from two sensors that never see quite the same moment, and blur and rolling shutters
//! spoil one more than the other. How far each is from what it claims is seen in its own residuals, and each is
//! weighed by that: places by where points are found off the motion's prediction, disparities by what the later map
//! says there. Windows of flow overlap, so that a pixel's place tells little beside its neighbours': against shape,
//! which does not overlap as much, it counts by the area over which its error is the same.

use nalgebra::{Matrix2, Vector2};

use super::solver::{SETTLED_SIGMAS, Solver};
use crate::constrain::LinearisationPoint;
use crate::estimate::MaximumLikelihoodOptions;
use crate::estimate::StudentT;
use crate::estimate::{SensedTrack, SensorErrors, TrackSource};
use crate::estimate::{SolvedMotion, Unsolvable};
use crate::geometry::distribution::{CHI2_1_P50_COARSE, CHI2_2_P50};
use crate::geometry::median;
use crate::geometry::{RigidMotion, StereoRig, Twist};
use crate::observe::{DensePair, StereoTrack};
use crate::pipeline::config::Config;
use crate::pipeline::plan::Interval;

/// The shape is looked at again at most this many times from where the last motion leads.
const SHAPE_ROUNDS: usize = 10;
/// Without a motion to start from, disparities further from the prediction than this are of another surface, in pixels.
/// The limit is halved round by round.
const FIRST_REACH_PX: f64 = 8.0;
/// In the end disparities further from the prediction than this are of another surface, in pixels.
const LAST_REACH_PX: f64 = 1.0;
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
    interval: &Interval<'_>,
) -> Result<SolvedMotion, Unsolvable> {
    // The mixture takes every residual as one in three dimensions; shape has one, beside which places would look like outliers.
    let config = &without_mixture(interval.config);
    let tracked = Tracked { flow: pair.every(config.sample_step_px, DensePair::stereo_track), corners };
    let mut phi = start.copied().unwrap_or_else(Twist::zero);
    let mut reach = if start.is_some() { LAST_REACH_PX } else { FIRST_REACH_PX };
    let mut errors = interval.config.tolerance.prior_over(interval.dt_s).expected();
    let mut round = 0;
    loop {
        let near = reach <= LAST_REACH_PX;
        let all = observations(pair, &tracked, &phi, &errors, reach, config);
        let solver = Solver::new(pair.rig, &phi, config);
        // Far from the answer it is not the sensor that is wrong.
        let solver = if near { solver.with_tolerance(interval.dt_s) } else { solver };
        let found = solver.round(&all, &mut errors)?;
        let moved = found.motion.moved_from(&phi);
        phi = found.motion.phi_or_zero();
        round += 1;
        if (near && moved.is_finite() && moved < SETTLED_SIGMAS) || round == SHAPE_ROUNDS {
            return Ok(found);
        }
        reach = (0.5 * reach).max(LAST_REACH_PX);
    }
}

fn without_mixture(config: &Config) -> Config {
    let own = &config.maximum_likelihood;
    let kernel = StudentT { fitted: false, ..own.kernel };
    Config { maximum_likelihood: MaximumLikelihoodOptions { kernel, ..*own }, ..config.clone() }
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
    phi: &Twist,
    errors: &SensorErrors,
    reach_px: f64,
    config: &Config,
) -> Vec<SensedTrack> {
    let (rig, at) = (pair.rig, LinearisationPoint::new(*phi, pair.rig));
    let (motion, seen_by_depth) = (at.motion(), errors.apart.exp().after(at.motion()));
    let corrected = |track: StereoTrack, source| errors.corrected(&SensedTrack::new(track, source, rig), &at);
    let shapes = pair.every(config.sample_step_px, |pair, u, v| {
        let track = pair.shape_track(u, v, &seen_by_depth, reach_px)?;
        Some((corrected(track, TrackSource::Depth), pair.flow.get(u, v).is_some()))
    });
    let squares = shapes.iter().filter_map(|(shape, _)| across_surface(&shape.track, rig, motion));
    let disparity = factor(squares.collect(), CHI2_1_P50_COARSE);
    let placed = |tracks: &[StereoTrack], overlap: f64| {
        let mut tracks: Vec<SensedTrack> =
            tracks.iter().map(|&track| corrected(track, TrackSource::Image)).collect();
        let squares = tracks.iter().filter_map(|sensed| along_surface(&sensed.track, rig, motion));
        let place = factor(squares.collect(), CHI2_2_P50) * overlap;
        tracks.iter_mut().for_each(|sensed| sensed.track = scaled(&sensed.track, place, disparity));
        tracks
    };
    let mut all = placed(&tracked.flow, overlap(config));
    all.extend(placed(tracked.corners, 1.0));
    let elsewhere = shapes.into_iter().filter(|(_, tracked)| !tracked);
    all.extend(
        elsewhere.map(|(shape, _)| SensedTrack { track: scaled(&shape.track, 1.0, disparity), ..shape }),
    );
    all
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
