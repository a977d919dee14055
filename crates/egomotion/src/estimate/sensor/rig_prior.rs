//! How well a stereo rig is known before its images are looked at.

use documented::DocumentedFields;
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::tolerance::Tolerance;
use crate::geometry::{RIG_ERRORS, RigErrors, StereoRig};

/// What rows do not show may be this many times as large as what they show, in pixels at the image's edge.
///
/// Rows show only the vertical part of a wrong calibration; yaw, focal lengths and distortion act along rows as well.
/// On the four KITTI scenes with laser truth the offset of disparity is 0.6 to 3.1 times the disagreement of rows; this is
/// the cautious end.
const UNSEEN_PER_ROW_DISAGREEMENT: f64 = 3.0;

/// What is known of the errors of a stereo rig (`[rig_errors]`): values and standard deviations.
///
/// Values are those of the right camera alone, which the calibration of a rectified rig cannot express; a known error of
/// the focal length, the principal point or the baseline is put right in the calibration itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct RigPrior {
    /// Known turn of the right camera about its Y axis, in degrees: it is taken away.
    pub yaw_deg: f64,
    /// Standard deviation of what is left of it, in degrees; without it, what the rows of the images allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yaw_sigma_deg: Option<f64>,
    /// Known turn of the right camera about its X axis, in degrees: it is taken away.
    pub pitch_deg: f64,
    /// Standard deviation of what is left of it, in degrees; without it, what the rows of the images allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pitch_sigma_deg: Option<f64>,
    /// Known turn of the right camera about its Z axis, in degrees: it is taken away.
    pub roll_deg: f64,
    /// Standard deviation of what is left of it, in degrees; without it, what the rows of the images allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roll_sigma_deg: Option<f64>,
    /// Known excess of the right focal length over the left one, as a share of it: it is taken away.
    pub focal_ratio: f64,
    /// Standard deviation of what is left of it, as a share of it; without it, what the rows of the images allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_ratio_sigma: Option<f64>,
    /// Standard deviation of the focal length of both cameras, as a share of it; without it, what the rows of the images allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_sigma: Option<f64>,
    /// Standard deviation of the principal point of both cameras along x, in pixels; without it, what the rows of the images
    /// allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_x_sigma_px: Option<f64>,
    /// Standard deviation of the principal point of both cameras along y, in pixels; without it, what the rows of the images
    /// allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_y_sigma_px: Option<f64>,
    /// Standard deviation of the baseline, as a share of it; without it, what the rows of the images allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baseline_sigma: Option<f64>,
}

impl RigPrior {
    /// The values; those of the calibration itself are 0.
    pub fn values(&self) -> RigErrors {
        from_units([self.yaw_deg, self.pitch_deg, self.roll_deg, self.focal_ratio, 0.0, 0.0, 0.0, 0.0])
    }

    /// Standard deviations where each is given, in the order and the units of [`RigErrors::NAMES`].
    pub fn stated(&self) -> [Option<f64>; RIG_ERRORS] {
        [
            self.yaw_sigma_deg,
            self.pitch_sigma_deg,
            self.roll_sigma_deg,
            self.focal_ratio_sigma,
            self.focal_sigma,
            self.centre_x_sigma_px,
            self.centre_y_sigma_px,
            self.baseline_sigma,
        ]
    }

    /// A rig that is exactly as it is stated: one that is rendered.
    pub fn exact() -> Self {
        Self::default().with_sigmas([0.0; RIG_ERRORS])
    }

    /// The same with other standard deviations, in the order and the units of [`RigErrors::NAMES`].
    #[must_use]
    pub fn with_sigmas(mut self, sigmas: [f64; RIG_ERRORS]) -> Self {
        let places = [
            &mut self.yaw_sigma_deg,
            &mut self.pitch_sigma_deg,
            &mut self.roll_sigma_deg,
            &mut self.focal_ratio_sigma,
            &mut self.focal_sigma,
            &mut self.centre_x_sigma_px,
            &mut self.centre_y_sigma_px,
            &mut self.baseline_sigma,
        ];
        places.into_iter().zip(sigmas).for_each(|(place, sigma)| *place = Some(sigma));
        self
    }

    /// Standard deviations of the errors, of a rig whose rows disagree by `rows_px`.
    ///
    /// Without a stated one, an error moves matches at the image's edge by as much as rows disagree if rows would show it
    /// (pitch, roll, ratio), and by three times as much if not; the sensor's tolerance takes the place of that rule.
    pub fn sigma(&self, rows_px: f64, tolerance: &Tolerance, rig: &StereoRig) -> RigErrors {
        let (seen, unseen) = (rows_px, UNSEEN_PER_ROW_DISAGREEMENT * rows_px);
        let (f, edge) = (rig.focal_px, (0.5 * rig.width_px as f64).max(1.0));
        let by_rows = RigErrors {
            yaw_rad: unseen / f,
            pitch_rad: seen / f,
            roll_rad: seen / edge,
            focal_ratio: seen / edge,
            focal: unseen / edge,
            centre_x_px: unseen,
            centre_y_px: unseen,
            baseline: unseen / edge,
        };
        let rule = if tolerance.is_exact() { by_rows } else { tolerance.of_rig(by_rows) };
        let stated = self.stated();
        let in_units = |i: usize| rule.vector()[i] / RigErrors::UNITS[i];
        from_units(std::array::from_fn(|i| stated[i].unwrap_or_else(|| in_units(i))))
    }

    /// Whether each number is one that it can be.
    pub(crate) fn is_valid(&self) -> bool {
        let sigmas = self.stated();
        self.values().vector().iter().all(|value| value.is_finite())
            && sigmas.iter().flatten().all(|sigma| sigma.is_finite() && *sigma >= 0.0)
    }
}

fn from_units(numbers: [f64; RIG_ERRORS]) -> RigErrors {
    RigErrors::from_vector(&SVector::from_fn(|i, _| numbers[i] * RigErrors::UNITS[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stated_goes_before_the_rule_of_rows() {
        let rig = StereoRig::new(700.0, (612.0, 180.0), 0.54, (1224, 370)).unwrap();
        let none = Tolerance::default();
        let sigma = RigPrior::default().sigma(0.35, &none, &rig);
        // An offset of disparity of about a pixel.
        assert!((sigma.yaw_rad * rig.focal_px - 1.05).abs() < 1e-12);
        assert!((sigma.roll_rad * 612.0 - 0.35).abs() < 1e-12 && (sigma.focal * 612.0 - 1.05).abs() < 1e-12);
        let stated = RigPrior { yaw_sigma_deg: Some(0.01), yaw_deg: 0.02, ..RigPrior::default() };
        assert!((stated.sigma(0.35, &none, &rig).yaw_rad - 0.01_f64.to_radians()).abs() < 1e-15);
        assert!((stated.values().yaw_rad - 0.02_f64.to_radians()).abs() < 1e-15);
        assert_eq!(stated.sigma(0.35, &none, &rig).focal, sigma.focal);
        assert!(RigPrior::exact().sigma(0.35, &none, &rig).is_none());
        // A sensor's tolerance says what its calibration is worth.
        let rendered = RigPrior::default().sigma(0.35, &Tolerance::rendered(), &rig);
        assert_eq!((rendered.focal, rendered.baseline, rendered.yaw_rad), (1.5e-3, 5e-4, sigma.yaw_rad));
        assert!(!RigPrior { roll_sigma_deg: Some(-1.0), ..RigPrior::default() }.is_valid());
    }
}
