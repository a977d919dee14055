//! Corners followed in time and across the rig: the measurements of [`StereoTrack`].
//!
//! A corner of the left image is located in the right image of its time, in the left image of the
//! next frame and from there in the right one, and back again (the four-way check). Each of the
//! four images localises the corner with its own independent noise (`Localisation`), from which
//! the covariance of (x, y, d) at either end follows.
//!
//! Where a corner was found, with its disparity, is where the next pair follows it from: it lives
//! as long as it is found. Its window is taken anew in every frame. Nothing drifts, because a
//! pair's motion is measured between two places of the same window, whatever corner it once was.
//!
//! Where disparity is handed in from outside in place of a right image ([`Hints::external_disparity`]), it is read from the map.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rayon::prelude::*;

use super::corners::{Corner, CornerCells, corners};
use super::follow::{Across, Follower, Time, is_masked};
use super::observation::StereoTrack;
use super::patch::{self, Localisation};
use super::row_search::search_row;
use super::stereo_pyramid::StereoPyramid;
use crate::geometry::{Gaussian, Grid, StereoRig, upper_median};

pub use super::follow::{Hints, SearchStart, StereoCorner, Trace, TrackOptions};

/// Variance of a grey level rounded to whole numbers, in squared grey levels: the least that an image can have.
const QUANTISATION: f64 = 1.0 / 12.0;
/// A window's own variance of grey levels counts where it is this many times the pair's: a window has some twenty
/// independent grey levels, whose chance scatters it by a third.
const OWN_VARIANCE_RATIO: f64 = 1.8;
/// Variance of a grey level where no match tells it, in squared grey levels.
const UNKNOWN_VARIANCE: f64 = 1.0;
/// Least side of the cells that corners are spread over, in pixels.
const LEAST_CELL_PX: f64 = 4.0;
/// Border that is kept free of corners beyond the reach of a window, in pixels.
const BORDER_PX: usize = 3;

/// The corners of a frame: those `kept` from following earlier ones, and new ones where there are none; the order is fixed.
pub fn stereo_corners(
    frame: &StereoPyramid,
    kept: &[StereoCorner],
    rig: &StereoRig,
    hints: Hints<'_>,
    options: &TrackOptions,
) -> Vec<StereoCorner> {
    let (width, height) = frame.left.size();
    let cell = ((width * height) as f64 / options.corners.max(1) as f64).sqrt().max(LEAST_CELL_PX) as usize;
    let cells = CornerCells::new((width, height), cell, patch::RADIUS + BORDER_PX);
    let (across, down) = cells.count();
    let mut taken = Grid::filled(across, down, false);
    let mut claim = |corner: &&StereoCorner| {
        cells.of(corner.u, corner.v).is_some_and(|(a, b)| {
            let free = !taken.at(a, b);
            taken.set(a, b, true);
            free
        })
    };
    let mut all: Vec<StereoCorner> = kept.iter().filter(|corner| claim(corner)).copied().collect();
    let Some(image) = frame.left.levels().first() else { return all };
    let mut found = corners(image, &cells, &taken, options.least_strength);
    if let Some(mask) = hints.mask {
        found.retain(|c| !is_masked(mask, c.u as f64, c.v as f64));
    }
    let follower =
        Follower { before: frame, after: frame, rig, hints, options, start: SearchStart::FullResolution };
    let locate = |corner: &Corner| {
        let shift = match hints.shift {
            Some(field) => f64::from(field.get(corner.u, corner.v)?),
            None if hints.external_disparity.is_some() => 0.0,
            None => search_row(frame, corner.u, corner.v, options.largest_disparity_px)?,
        };
        follower.across(frame, Time::Earlier, (corner.u as f64, corner.v as f64), shift, 0)
    };
    let new: Vec<Option<StereoCorner>> = found.par_iter().map(locate).collect();
    all.extend(new.into_iter().flatten());
    all
}

/// Corners of `before` followed to `after`; the order is theirs.
pub fn follow(
    before: &StereoPyramid,
    after: &StereoPyramid,
    corners: &[StereoCorner],
    rig: &StereoRig,
    hints: Hints<'_>,
    start: SearchStart,
    options: &TrackOptions,
) -> Vec<Trace> {
    let follower = Follower { before, after, rig, hints, options, start };
    let traces: Vec<Option<Trace>> = corners.par_iter().map(|corner| follower.trace(corner)).collect();
    traces.into_iter().flatten().collect()
}

/// The tracks that all traces of a pair measure, with covariances from the noise that they share.
pub fn tracks_from_traces(traces: &[Trace], rig: &StereoRig) -> Vec<StereoTrack> {
    let noise = GreyNoise::of(traces);
    traces.iter().filter_map(|trace| trace.track(rig, noise)).collect()
}

/// Corners of `before` found and followed to `after`, as tracks with covariances; the order is fixed.
///
/// With `hints.motion` they are expected where the still world's points would be.
pub fn stereo_tracks(
    before: &StereoPyramid,
    after: &StereoPyramid,
    rig: &StereoRig,
    hints: Hints<'_>,
    options: &TrackOptions,
) -> Vec<StereoTrack> {
    let corners = stereo_corners(before, &[], rig, hints, options);
    let start = hints.motion.map_or(SearchStart::Level(usize::MAX), |_| SearchStart::FullResolution);
    tracks_from_traces(&follow(before, after, &corners, rig, hints, start, options), rig)
}

/// Variance of a grey level of one image, as the matches show it.
#[derive(Debug, Clone, Copy)]
struct GreyNoise {
    /// From frame to frame.
    time: f64,
    /// Between the cameras, which see a surface from two sides.
    rig: f64,
}

impl GreyNoise {
    /// From the medians of all matches of a pair.
    fn of(traces: &[Trace]) -> Self {
        Self {
            time: median(traces.iter().map(Trace::grey_variance).collect()),
            rig: median(
                traces.iter().flat_map(|t| [t.before, t.after]).filter_map(|c| c.grey_variance()).collect(),
            ),
        }
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    upper_median(&mut values, f64::total_cmp).unwrap_or(UNKNOWN_VARIANCE)
}

/// The variance of grey levels of one window, from the pair's and its own.
fn at_least(pooled: f64, own: f64) -> f64 {
    pooled.max(own / OWN_VARIANCE_RATIO).max(QUANTISATION)
}

impl Trace {
    /// Variance of a grey level from the two left windows.
    fn grey_variance(&self) -> f64 {
        0.5 * self.residual / self.before.localisation.left_over
    }

    /// The track with its covariances, given the pooled variances of grey levels.
    fn track(&self, rig: &StereoRig, noise: GreyNoise) -> Option<StereoTrack> {
        let time = at_least(noise.time, self.grey_variance());
        let end = |corner: &StereoCorner| {
            let rig_noise = corner.grey_variance().map_or(noise.rig, |own| at_least(noise.rig, own));
            corner.observed(rig, GreyNoise { time, rig: rig_noise })
        };
        let (before, after) = (end(&self.before), end(&self.after));
        (before.mean.z > 0.0 && after.mean.z > 0.0).then_some(StereoTrack { before, after })
    }
}

impl StereoCorner {
    /// Variance of a grey level from the left and the right window.
    fn grey_variance(&self) -> Option<f64> {
        match self.across {
            Across::Matched { residual } => Some(0.5 * residual / self.localisation.left_over),
            Across::Read { .. } => None,
        }
    }

    /// (x, y, d) given the variances of grey levels.
    fn observed(&self, rig: &StereoRig, noise: GreyNoise) -> Gaussian<3> {
        let (x, y) = rig.image_from_pixel(self.u, self.v);
        let Localisation { plane, plane_row, row, .. } = &self.localisation;
        let ratio = rig.aspect();
        let place = plane * noise.time;
        let place = Matrix2::new(place.m11, place.m12 * ratio, place.m12 * ratio, place.m22 * ratio * ratio);
        let (cross, variance) = match self.across {
            // d is located along the row alone, from the same noise of the left window as x and y; the
            // right window adds as much again.
            Across::Matched { .. } => {
                let both = noise.time.min(noise.rig);
                let cross = Vector2::new(plane_row.x * both, plane_row.y * both * ratio);
                (cross, 2.0 * row * noise.rig)
            }
            // d is read where the window was found, so an error of the place moves it along the map's slope.
            Across::Read { variance, slope } => {
                let slope = Vector2::new(slope.0, slope.1 / ratio);
                let cross = place * slope;
                (cross, variance + slope.dot(&cross))
            }
        };
        let (xx, xy, yy) = (place.m11, place.m12, place.m22);
        let cov = Matrix3::new(xx, xy, cross.x, xy, yy, cross.y, cross.x, cross.y, variance);
        Gaussian { mean: Vector3::new(x, y, rig.disparity_from_shift(self.shift)), cov }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;

    use super::*;
    use crate::simd::PLAIN;

    #[test]
    fn wide_and_plain_kernels_give_the_same_bits() {
        let grey = |u: f64, v: f64| {
            let wave = |a: f64, b: f64, c: f64| (a * u + b * v + c).sin() * (b * u - a * v).cos();
            (120.0
                + 30.0 * wave(0.31, 0.12, 0.0)
                + 25.0 * wave(-0.13, 0.26, 1.0)
                + 40.0 * wave(0.05, 0.07, 2.0)) as f32
        };
        let image = |shift: f64| Grid::from_fn(213, 151, |u, v| grey(u as f64 + shift, v as f64));
        let rig = StereoRig::new(300.0, (99.5, 74.5), 0.1, (213, 151)).unwrap();
        let all = || {
            let before = StereoPyramid::new(&image(0.0), &image(9.3), 4);
            let after = StereoPyramid::new(&image(0.7), &image(10.0), 4);
            let tracks = stereo_tracks(&before, &after, &rig, Hints::default(), &TrackOptions::default());
            (before.left, before.right_spline, tracks)
        };
        let wide = all();
        PLAIN.store(true, Ordering::Relaxed);
        let plain = all();
        PLAIN.store(false, Ordering::Relaxed);
        assert!(wide.2.len() > 100, "{}", wide.2.len());
        assert!(wide.0 == plain.0 && wide.1 == plain.1);
        assert_eq!(wide.2, plain.2);
    }
}
