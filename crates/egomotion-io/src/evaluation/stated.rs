//! Whether the stated uncertainty is true: φ of `motion.csv` against true poses.

use std::path::Path;

use egomotion::geometry::distribution::NORMAL_P975_COARSE;
use egomotion::geometry::{RigidMotion, Twist};
use egomotion::metrics::{Coverage, Nees, associate};
use serde_json::{Value, json};

use super::EvaluationOptions;
use super::trajectories::poses;
use crate::IoError;
use crate::tables::motion_table::{self, MotionRow};

/// NEES and coverage of φ.
#[derive(Debug, Clone, PartialEq)]
pub struct StatedUncertainty {
    /// Over whole motions.
    pub nees: Nees,
    /// Of the components' 95 % intervals.
    pub components: Coverage,
}

impl StatedUncertainty {
    /// `None` where the estimate is not the folder of a run, or the truth has no time stamps.
    pub(super) fn read(
        estimate: &Path,
        truth: &Path,
        options: &EvaluationOptions,
    ) -> Result<Option<Self>, IoError> {
        let file = estimate.join("motion.csv");
        if !file.is_file() {
            return Ok(None);
        }
        let truth = poses(truth, None)?;
        let Some(times) = truth.iter().map(|pose| pose.time_s).collect::<Option<Vec<f64>>>() else {
            return Ok(None);
        };
        let truth: Vec<RigidMotion> = truth.iter().map(|pose| pose.world_from_camera).collect();
        let mut stated = Self { nees: Nees::default(), components: Coverage::default() };
        for row in motion_table::read(&file)? {
            stated.add(&row, &times, &truth, options);
        }
        Ok((stated.nees.count > 0).then_some(stated))
    }

    fn add(&mut self, row: &MotionRow, times_s: &[f64], truth: &[RigidMotion], options: &EvaluationOptions) {
        let Some(motion) = row.motion.as_ref().filter(|motion| motion.is_complete()) else { return };
        let Some(dt_s) = row.dt_s else { return };
        let at = associate(&[row.time_s - dt_s, row.time_s], times_s, options.largest_gap_s);
        let [(_, before), (_, after)] = at[..] else { return };
        let phi: Twist = truth[after].inverse().after(&truth[before]).log();
        let mut stated = motion.phi;
        for (i, sigma) in options.truth_sigma.iter().enumerate() {
            stated.cov[(i, i)] += sigma * sigma;
        }
        self.nees.add(&stated, &phi.vector());
        for i in 0..6 {
            let reach = NORMAL_P975_COARSE * stated.sigma(i);
            self.components.add(stated.mean[i] - reach, stated.mean[i] + reach, phi.vector()[i]);
        }
    }

    pub(super) fn json(&self) -> Value {
        json!({ "nees_over_6": self.nees.per_degree(), "coverage_95": self.components.share(),
                "motions": self.nees.count })
    }
}
