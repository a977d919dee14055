//! How well a sensor is known, and the prior that this makes of its errors over an interval.

use documented::DocumentedFields;
use nalgebra::{SVector, Vector3};
use serde::{Deserialize, Serialize};

use super::errors::{ERRORS, SensorErrors};
use crate::geometry::{RigErrors, Twist};

/// Standard deviation of the linear acceleration of a camera that is held in a hand, in m/s²: walking hands accelerate
/// by some m/s².
pub const HAND_ACCELERATION_M_S2: f64 = 2.0;
/// Standard deviation of the angular acceleration of a camera that is held in a hand, in rad/s²: a wrist that turns to
/// and fro twice a second by 5° accelerates by up to 14 rad/s².
pub const HAND_ACCELERATION_RAD_S2: f64 = 5.0;

/// Standard deviation of a read-out time, as a share of it: a sensor's kind tells no more of its shutter.
///
/// A larger share lets the bias of matching pass for a shutter where little moves. With this one a rendered Kinect with a
/// global shutter, which was not told so, had NEES/6 of 1.3 over 100 pairs.
const READOUT_SHARE: f64 = 0.25;

/// How well a sensor is known: standard deviations; 0 is exact.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct Tolerance {
    /// Of the focal length, as a share of it.
    pub focal: f64,
    /// Of each coordinate of the principal point, in pixels.
    pub centre_px: f64,
    /// Of the scale of depth (of a stereo rig: of its baseline), as a share of it.
    pub scale: f64,
    /// Time from an image's first row to its last, in seconds, known to a quarter of it: 0 with a global shutter; depth
    /// images count as having one, and a stereo rig's images too.
    pub readout_s: f64,
    /// Of the time between a depth image and its image, in seconds.
    pub delay_s: f64,
}

impl Tolerance {
    /// Whether nothing is allowed for.
    pub fn is_exact(&self) -> bool {
        *self == Self::default()
    }

    /// Whether each number is one that a standard deviation can be.
    pub(crate) fn is_valid(&self) -> bool {
        let Self { focal, centre_px, scale, readout_s, delay_s } = *self;
        [focal, centre_px, scale, readout_s, delay_s].iter().all(|sigma| sigma.is_finite() && *sigma >= 0.0)
    }

    /// Of rendered images: conventions differ by whether pixels count from their centres or their corners.
    ///
    /// Half a pixel at either end of the image's width is in doubt, and with it the field of view; depth is at best
    /// what half-precision numbers hold, 2⁻¹¹.
    pub fn rendered() -> Self {
        Self { focal: 1.5e-3, centre_px: 0.3, scale: 5e-4, ..Self::default() }
    }

    /// Standard deviations of a rig's errors: its own of the focal length, the principal point and the scale, and those of
    /// the right camera as they are given.
    pub(super) fn of_rig(&self, right_camera: RigErrors) -> RigErrors {
        RigErrors {
            focal: self.focal,
            centre_x_px: self.centre_px,
            centre_y_px: self.centre_px,
            baseline: self.scale,
            ..right_camera
        }
    }

    /// The prior of the errors of a pair of frames that are `dt_s` seconds apart.
    pub(crate) fn prior_over(&self, dt_s: f64) -> SensorPrior {
        // An image is read to its end before the next.
        let readout = if dt_s > 0.0 { (self.readout_s / dt_s).min(1.0) } else { 0.0 };
        let [during, apart] = [self.readout_s, self.delay_s].map(|seconds| {
            [HAND_ACCELERATION_M_S2 * seconds * dt_s, HAND_ACCELERATION_RAD_S2 * seconds * dt_s]
        });
        let moving = |[t, omega]: [f64; 2]| Twist { t: Vector3::repeat(t), omega: Vector3::repeat(omega) };
        let none = SensorErrors::from_vector(&SVector::zeros());
        let mean = SensorErrors { readout, ..none };
        let rig = self.of_rig(RigErrors::default());
        let sigma = SensorErrors {
            rig,
            readout: READOUT_SHARE * readout,
            during: moving(during),
            apart: moving(apart),
        };
        SensorPrior { mean: mean.vector(), sigma: sigma.vector() }
    }
}

/// Means and standard deviations of the errors before anything is observed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SensorPrior {
    pub(crate) mean: SVector<f64, ERRORS>,
    pub(crate) sigma: SVector<f64, ERRORS>,
}

impl SensorPrior {
    /// Whether nothing is allowed for.
    pub(crate) fn is_exact(&self) -> bool {
        self.mean.amax() == 0.0 && self.sigma.amax() == 0.0
    }

    /// The errors that one expects.
    pub(crate) fn expected(&self) -> SensorErrors {
        SensorErrors::from_vector(&self.mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn priors_are_those_of_hands() {
        let tolerance = Tolerance { readout_s: 0.03, delay_s: 0.0, ..Tolerance::rendered() };
        let prior = tolerance.prior_over(0.1);
        assert!(!prior.is_exact() && Tolerance::default().prior_over(0.1).is_exact());
        // 2 m/s² and 5 rad/s² over 0.03 s change what happens in 0.1 s by 6 mm and .86°.
        assert!((prior.sigma[9] - 0.006).abs() < 1e-12 && (prior.sigma[14] - 0.015).abs() < 1e-12);
        assert_eq!(prior.sigma[17], 0.0);
        // Three tenths of the interval, or none, or at most all of it.
        assert!((prior.expected().readout - 0.3).abs() < 1e-12 && (prior.sigma[8] - 0.075).abs() < 1e-12);
        assert_eq!(Tolerance::rendered().prior_over(0.1).expected().vector().amax(), 0.0);
        assert_eq!(tolerance.prior_over(0.01).expected().readout, 1.0);
    }
}
