//! Whether the stated uncertainty is true: φ of `motion.csv` against true poses.

use std::path::Path;

use egomotion::geometry::distribution::NORMAL_P975_COARSE;
use egomotion::geometry::{RigCamera, RigidMotion, StereoRig, Twist};
use egomotion::metrics::{Coverage, Nees, associate};
use nalgebra::Vector3;
use serde::Deserialize;
use serde_json::{Value, json};

use super::EvaluationOptions;
use super::trajectories::poses;
use crate::tables::motion_table::{self, MotionRow};
use crate::{IoError, read};

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
        let camera = camera_centre(estimate)?;
        for row in motion_table::read(&file)? {
            stated.add(&row, &camera, &times, &truth, options);
        }
        Ok((stated.nees.count > 0).then_some(stated))
    }

    /// Add a row whose φ is that of the camera centred at `camera` in the left one's frame.
    fn add(
        &mut self,
        row: &MotionRow,
        camera: &Vector3<f64>,
        times_s: &[f64],
        truth: &[RigidMotion],
        options: &EvaluationOptions,
    ) {
        let Some(motion) = row.motion.as_ref().filter(|motion| motion.is_complete()) else { return };
        let Some(dt_s) = row.dt_s else { return };
        let at = associate(&[row.time_s - dt_s, row.time_s], times_s, options.largest_gap_s);
        let [(_, before), (_, after)] = at[..] else { return };
        let phi: Twist = truth[after].inverse().after(&truth[before]).log().seen_from(camera);
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

/// What a run's `summary.json` says of the camera whose φ it gives.
#[derive(Deserialize)]
struct GivenCamera {
    /// Runs from before it could be chosen are of the left one.
    #[serde(default)]
    frame: RigCamera,
    rig: Option<StereoRig>,
}

/// Centre of the camera whose φ a run gives, in the left camera's frame; that of the left one without a summary.
fn camera_centre(run: &Path) -> Result<Vector3<f64>, IoError> {
    let file = run.join("summary.json");
    if !file.is_file() {
        return Ok(Vector3::zeros());
    }
    let refuse = |why: String| {
        let reason = format!("does not say whose motion motion.csv gives: {why}");
        IoError::new(&file, reason, "give a folder as `egomotion run` writes it")
    };
    let given: GivenCamera =
        serde_json::from_str(&read::text(&file)?).map_err(|why| refuse(why.to_string()))?;
    match (given.frame, given.rig) {
        (RigCamera::Left, _) => Ok(Vector3::zeros()),
        (camera, Some(rig)) => Ok(rig.centre_from_left(camera)),
        (_, None) => Err(refuse("it has no rig".into())),
    }
}
