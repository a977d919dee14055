//! Whether the stated uncertainty is true: φ of `motion.csv` against true poses.

use anyhow::Result;
use egomotion::geometry::{RigidMotion, Twist};
use egomotion::metrics::{Coverage, Nees, associate};
use egomotion_io::motion_table::{self, MotionRow};
use serde_json::{Value, json};

use crate::args::EvaluateArgs;
use crate::evaluate::trajectories::poses;

/// NEES and coverage of φ.
pub struct Stated {
    nees: Nees,
    components: Coverage,
}

impl Stated {
    /// `None` where the estimate is not the folder of a run, or the truth has no time stamps.
    pub fn read(args: &EvaluateArgs) -> Result<Option<Self>> {
        let file = args.estimate.join("motion.csv");
        if !file.is_file() {
            return Ok(None);
        }
        let truth = poses(&args.truth, None)?;
        let Some(times) = truth.iter().map(|pose| pose.time_s).collect::<Option<Vec<f64>>>() else {
            return Ok(None);
        };
        let truth: Vec<RigidMotion> = truth.iter().map(|pose| pose.world_from_camera).collect();
        let mut stated = Self { nees: Nees::default(), components: Coverage::default() };
        for row in motion_table::read(&file)? {
            stated.add(&row, &times, &truth, args);
        }
        Ok((stated.nees.count > 0).then_some(stated))
    }

    fn add(&mut self, row: &MotionRow, times_s: &[f64], truth: &[RigidMotion], args: &EvaluateArgs) {
        let Some(motion) = row.motion.as_ref().filter(|motion| motion.is_complete()) else { return };
        let Some(dt_s) = row.dt_s else { return };
        let at = associate(&[row.time_s - dt_s, row.time_s], times_s, args.max_diff);
        let [(_, before), (_, after)] = at[..] else { return };
        let phi: Twist = truth[after].inverse().after(&truth[before]).log();
        let mut stated = motion.phi;
        for (i, sigma) in args.truth_sigma().into_iter().enumerate() {
            stated.cov[(i, i)] += sigma * sigma;
        }
        self.nees.add(&stated, &phi.vector());
        for i in 0..6 {
            let reach = 1.96 * stated.sigma(i);
            self.components.add(stated.mean[i] - reach, stated.mean[i] + reach, phi.vector()[i]);
        }
    }

    pub fn json(&self) -> Value {
        json!({ "nees_over_6": self.nees.per_degree(), "coverage_95": self.components.share(),
                "motions": self.nees.count })
    }

    pub fn text(&self) -> String {
        format!(
            "stated uncertainty: NEES/6 {:.2}; {:.1} % of {} components in their 95 % interval\n",
            self.nees.per_degree().unwrap_or(f64::NAN),
            100.0 * self.components.share().unwrap_or(f64::NAN),
            self.components.total()
        )
    }
}
