//! Measurements of the synthetic world: exact values, plus noise, then rounded.

use std::ops::RangeInclusive;

use rand::seq::index::sample;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use super::range::{COUNTS, OutOfRange, within};
use super::world::{UsablePixel, When, World};
use egomotion::geometry::{Gaussian, rounding_variance};
use egomotion::observe::{DepthFlow, DepthTrack, StereoFlow, StereoTrack};

/// Standard deviation that an exact measurement is given, in pixels: weights must stay finite.
const LEAST_SIGMA_PX: f64 = 1e-4;

/// Fewer points do not determine any motion that a noise of one eighth of a pixel leaves standing.
pub const LEAST_FEATURES: usize = 8;
const FEATURES: RangeInclusive<usize> = LEAST_FEATURES..=*COUNTS.end();
/// Levels of disparity for each pixel.
const LEVELS: RangeInclusive<u32> = 1..=4096;
/// More noise than an image is wide says nothing.
const NOISE_PX: RangeInclusive<f64> = 0.0..=1000.0;

/// What the measurements suffer from: the parameters of the six sweeps but STEP.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Measuring {
    /// ROUND: levels of disparity for each pixel; `None` is infinite.
    pub round: Option<u32>,
    /// STD_DISP: standard deviation of the noise of disparity, before rounding, in pixels.
    pub std_disp_px: f64,
    /// STD_VEL: standard deviation of the noise of differential flow, in pixels.
    pub std_vel_px: f64,
    /// STD_TRACK: standard deviation of the noise of discrete displacement, in pixels.
    pub std_track_px: f64,
    /// FEATURES: number of tracked features in the discrete form.
    pub features: usize,
}

impl Default for Measuring {
    fn default() -> Self {
        Self::real()
    }
}

impl Measuring {
    /// The baseline `clean`: nothing added, nothing rounded.
    pub fn clean() -> Self {
        Self { round: None, std_disp_px: 0.0, std_vel_px: 0.0, std_track_px: 0.0, features: 2048 }
    }

    /// The baseline `real`: 1/16 px of disparity, 1/8 px of noise in everything.
    pub fn real() -> Self {
        Self { round: Some(16), std_disp_px: 0.125, std_vel_px: 0.125, std_track_px: 0.125, features: 2048 }
    }

    /// Nothing if this can be measured.
    ///
    /// # Errors
    /// [`OutOfRange`]: negative noise, no levels, or too few features for any motion.
    pub fn check(&self) -> Result<(), OutOfRange> {
        within("round", self.round.unwrap_or(1), &LEVELS)?;
        within("std_disp_px", self.std_disp_px, &NOISE_PX)?;
        within("std_vel_px", self.std_vel_px, &NOISE_PX)?;
        within("std_track_px", self.std_track_px, &NOISE_PX)?;
        within("features", self.features, &FEATURES)
    }

    /// Variance of a measured disparity: its noise and its rounding, (52).
    pub fn disparity_variance(&self) -> f64 {
        self.std_disp_px.powi(2) + self.round.map_or(0.0, |levels| rounding_variance(1.0 / f64::from(levels)))
    }

    /// A measured disparity: noise first, then floor(d R + ½)/R.
    fn disparity(&self, exact: f64, noise: &mut Noise) -> f64 {
        let noisy = exact + self.std_disp_px * noise.next();
        self.round.map_or(noisy, |levels| {
            let levels = f64::from(levels);
            (noisy * levels + 0.5).floor() / levels
        })
    }

    fn disparities(&self, exact: &[f64], noise: &mut Noise) -> Vec<f64> {
        exact.iter().map(|&d| self.disparity(d, noise)).collect()
    }
}

/// Unit Gaussian noise.
struct Noise(Pcg64Mcg);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }
}

/// One draw: pixels of the world, and what was measured at each.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw<'a, Change, Motion> {
    /// The truth of each pixel.
    pub pixels: Vec<&'a UsablePixel>,
    /// What the depth change constraint takes.
    pub changes: Vec<Change>,
    /// What binocular flow takes.
    pub motions: Vec<Motion>,
    /// All that was measured, which is what maximum likelihood takes.
    pub complete: Vec<Motion>,
}

impl<'a, Change, Motion> Draw<'a, Change, Motion> {
    fn of(pixels: Vec<&'a UsablePixel>) -> Self {
        Self { pixels, changes: Vec::new(), motions: Vec::new(), complete: Vec::new() }
    }
}

/// Every usable pixel with its velocities.
pub type Differential<'a> = Draw<'a, DepthFlow, StereoFlow>;
/// Random features with their displacements.
pub type Discrete<'a> = Draw<'a, DepthTrack, StereoTrack>;

/// σ² of a measurement, never zero.
fn held(variance: f64) -> f64 {
    variance.max(LEAST_SIGMA_PX * LEAST_SIGMA_PX)
}

/// Half the difference of the neighbours along x and along y, central differences of 1 px.
fn gradient(disparity: &[f64], index: usize, width: usize) -> [f64; 2] {
    let half = |a: usize, b: usize| 0.5 * (disparity[a] - disparity[b]);
    [half(index + 1, index - 1), half(index + width, index - width)]
}

/// Dense measurements of the differential form, with the noise of `seed`.
///
/// Each pixel of the three disparity maps has noise of its own; d_t is half the difference of t + 1 and t − 1.
/// The right camera's flow is that of the same point; its v_y, which is the left one's, is a second measurement
/// that the paper's methods do not use.
pub fn differential<'a>(world: &'a World, measuring: &Measuring, seed: u64) -> Differential<'a> {
    let mut noise = Noise(Pcg64Mcg::seed_from_u64(seed));
    let maps = [When::Before, When::Now, When::After]
        .map(|when| measuring.disparities(world.disparity(when), &mut noise));
    let (var_d, var_v) = (held(measuring.disparity_variance()), held(measuring.std_vel_px.powi(2)));
    let pixels: Vec<&UsablePixel> = world.pixels().iter().filter(|p| p.differential).collect();
    let mut draw = Draw::of(pixels);
    for p in &draw.pixels {
        let [dx, dy] = gradient(&maps[1], p.index, world.rig.width_px);
        let (d, dt) = (maps[1][p.index], 0.5 * (maps[2][p.index] - maps[0][p.index]));
        let mut velocity = |exact: f64| exact + measuring.std_vel_px * noise.next();
        let [vx, vy, right_x] = [p.flow_left.x, p.flow_left.y, p.flow_right_x].map(&mut velocity);
        let right_y = velocity(p.flow_left.y);
        let (x_px, y_px) = (p.xyd.x, p.xyd.y);
        let half = 0.5 * var_d;
        draw.changes.push(DepthFlow {
            x_px,
            y_px,
            disparity: Gaussian::independent([d, dx, dy, dt], [var_d, half, half, half]),
            flow: Gaussian::independent([vx, vy], [var_v; 2]),
        });
        let flow = |vy: f64, var_vy: f64| StereoFlow {
            x_px,
            y_px,
            measured: Gaussian::independent([d, vx, vy, right_x], [var_d, var_v, var_vy, var_v]),
        };
        draw.motions.push(flow(vy, var_v));
        draw.complete.push(flow(0.5 * (vy + right_y), 0.5 * var_v));
    }
    draw
}

/// Random features of the discrete form, without replacement, with the noise of `seed`.
///
/// A feature is an integer pixel at t, so that (x, y) is exact there; STD_TRACK is added to the later end; its
/// d′ is its own disparity at t′.
pub fn discrete<'a>(world: &'a World, measuring: &Measuring, seed: u64) -> Discrete<'a> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let all: Vec<&UsablePixel> = world.pixels().iter().filter(|p| p.discrete).collect();
    let chosen = sample(&mut rng, all.len(), measuring.features.min(all.len()));
    let pixels: Vec<&UsablePixel> = chosen.iter().map(|i| all[i]).collect();
    let mut noise = Noise(rng);
    let maps = [When::Now, When::After].map(|when| measuring.disparities(world.disparity(when), &mut noise));
    let mut draw = Draw::of(pixels);
    for p in &draw.pixels {
        let later = [
            p.later_xyd.x + measuring.std_track_px * noise.next(),
            p.later_xyd.y + measuring.std_track_px * noise.next(),
            measuring.disparity(p.later_xyd.z, &mut noise),
        ];
        let [dx, dy] = gradient(&maps[1], p.index, world.rig.width_px);
        let (d, after) = (maps[0][p.index], maps[1][p.index]);
        let track = track(p, d, later, measuring);
        let var_d = track.after.cov[(2, 2)];
        draw.changes.push(DepthTrack {
            x_px: p.xyd.x,
            y_px: p.xyd.y,
            disparity: Gaussian::independent([d, after, dx, dy], [var_d, var_d, 0.5 * var_d, 0.5 * var_d]),
            displacement: Gaussian {
                mean: (track.after.mean - track.before.mean).xy(),
                cov: track.after.cov.fixed_view::<2, 2>(0, 0).into(),
            },
        });
        draw.motions.push(track);
    }
    draw.complete.clone_from(&draw.motions);
    draw
}

fn track(p: &UsablePixel, d: f64, later: [f64; 3], measuring: &Measuring) -> StereoTrack {
    let (var_d, var_t) = (held(measuring.disparity_variance()), held(measuring.std_track_px.powi(2)));
    StereoTrack {
        before: Gaussian::independent([p.xyd.x, p.xyd.y, d], [0.0, 0.0, var_d]),
        after: Gaussian::independent(later, [var_t, var_t, var_d]),
    }
}

impl Discrete<'_> {
    /// The exact tracks of the same features with the same covariances: where the bound is taken.
    pub fn exact(&self, measuring: &Measuring) -> Vec<StereoTrack> {
        self.pixels.iter().map(|p| track(p, p.xyd.z, p.later_xyd.into(), measuring)).collect()
    }
}

impl Differential<'_> {
    /// The exact flows of the same pixels with the same covariances: where the bound is taken.
    pub fn exact(&self) -> Vec<StereoFlow> {
        let truth = |(p, flow): (&&UsablePixel, &StereoFlow)| {
            let mean = [p.xyd.z, p.flow_left.x, p.flow_left.y, p.flow_right_x].into();
            StereoFlow { measured: Gaussian { mean, cov: flow.measured.cov }, ..*flow }
        };
        self.pixels.iter().zip(&self.complete).map(truth).collect()
    }
}
