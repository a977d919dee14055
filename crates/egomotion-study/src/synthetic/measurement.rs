//! How measurements of the synthetic world differ from the truth: noise, rounding, and the number of features.

use std::ops::RangeInclusive;

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use crate::range::{COUNTS, OutOfRange, within};
use egomotion::geometry::rounding_variance;

/// Least number of features that a study takes: fewer determine no motion once the noise is 1/8 px.
pub const LEAST_FEATURES: usize = 8;
/// Numbers of features that a study takes.
const FEATURES: RangeInclusive<usize> = LEAST_FEATURES..=*COUNTS.end();
/// Levels of disparity in a pixel that a study takes; 4096 is finer than any matcher.
const DISPARITY_LEVELS: RangeInclusive<u32> = 1..=4096;
/// Standard deviations of noise that a study takes, in pixels; more than an image is wide says nothing.
const NOISE_PX: RangeInclusive<f64> = 0.0..=1000.0;

/// Noise and rounding of the measurements: the parameters of the paper's sweeps (7.1), except STEP.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MeasurementModel {
    /// ROUND: levels of disparity in a pixel; `None` is infinite.
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

impl Default for MeasurementModel {
    fn default() -> Self {
        Self::real()
    }
}

impl MeasurementModel {
    /// The baseline `clean`: no noise and no rounding.
    pub fn clean() -> Self {
        Self { round: None, std_disp_px: 0.0, std_vel_px: 0.0, std_track_px: 0.0, features: 2048 }
    }

    /// The baseline `real`: disparity in steps of 1/16 px, noise of 1/8 px on everything.
    pub fn real() -> Self {
        Self { round: Some(16), std_disp_px: 0.125, std_vel_px: 0.125, std_track_px: 0.125, features: 2048 }
    }

    /// Check that a study can be run with this model.
    ///
    /// # Errors
    /// [`OutOfRange`]: negative noise, no levels, or fewer features than [`LEAST_FEATURES`].
    pub fn check(&self) -> Result<(), OutOfRange> {
        within("round", self.round.unwrap_or(1), &DISPARITY_LEVELS)?;
        within("std_disp_px", self.std_disp_px, &NOISE_PX)?;
        within("std_vel_px", self.std_vel_px, &NOISE_PX)?;
        within("std_track_px", self.std_track_px, &NOISE_PX)?;
        within("features", self.features, &FEATURES)
    }

    /// Variance of a measured disparity in pixels²: its noise and its rounding, (52).
    pub(crate) fn disparity_variance(&self) -> f64 {
        self.std_disp_px.powi(2) + self.round.map_or(0.0, |levels| rounding_variance(1.0 / f64::from(levels)))
    }

    /// A measured disparity: noise first, then floor(d R + ½)/R.
    pub(super) fn disparity(&self, exact: f64, normals: &mut UnitNormals) -> f64 {
        let noisy = exact + self.std_disp_px * normals.next();
        self.round.map_or(noisy, |levels| {
            let levels = f64::from(levels);
            (noisy * levels + 0.5).floor() / levels
        })
    }

    /// A measured map of disparity, each pixel with noise of its own.
    pub(super) fn disparities(&self, exact: &[f64], normals: &mut UnitNormals) -> Vec<f64> {
        exact.iter().map(|&d| self.disparity(d, normals)).collect()
    }
}

/// Random numbers of the standard normal distribution.
pub(super) struct UnitNormals(Pcg64Mcg);

impl UnitNormals {
    /// Those of a seed.
    pub(super) fn of_seed(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    /// Those that follow from a generator in use.
    pub(super) fn from_generator(rng: Pcg64Mcg) -> Self {
        Self(rng)
    }

    pub(super) fn next(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }
}
