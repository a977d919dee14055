//! The page as a whole: nothing in the input can break it or make it load anything.

use egomotion::estimate::{MotionEstimate, Undetermined};
use egomotion::geometry::{Field, Gaussian, Grid, Image, RigidMotion, StereoRig, Twist};
use egomotion::motion::{NoObstacle, TimeToImpact};
use egomotion::observe::{DisparityMap, FlowField};
use egomotion::pipeline::maps::MotionMaps;
use egomotion::pipeline::stereo::DenseResults;
use nalgebra::{Matrix6, Vector6};

use super::{Album, FramePictures, FrameRow, MOST_PICTURES, Report, render};

/// What a report refers to.
pub struct Run {
    pub rig: StereoRig,
    pub rows: Vec<FrameRow>,
    pub poses: Vec<RigidMotion>,
    pub truth: Option<Vec<RigidMotion>>,
    pub pictures: Vec<FramePictures>,
}

/// φ with all components observed, each with the variance `variance`.
pub fn motion(phi: &Vector6<f64>, variance: f64) -> MotionEstimate {
    let theta = Gaussian { mean: *phi, cov: Matrix6::from_diagonal_element(variance) };
    let undetermined = Undetermined::default();
    MotionEstimate { theta, observed: [true; 6], undetermined, rows: 900, inliers: 800, residual_scale: 1.0 }
}

impl Run {
    /// A first frame, and one more for each φ, 0.1 s apart.
    pub fn of(phis: &[Vector6<f64>]) -> Self {
        let row = |k: usize, phi: Option<&Vector6<f64>>| FrameRow {
            frame: k,
            time_s: 0.1 * k as f64,
            dt_s: phi.map(|_| 0.1),
            motion: phi.map(|phi| motion(phi, 1e-6)),
            truth: phi.map(Twist::from_vector),
            impact: phi
                .map(|_| TimeToImpact { looming: Gaussian::scalar(0.5, 1e-3) })
                .ok_or(NoObstacle::NothingMeasured),
            status: if phi.is_some() { "ok" } else { "first" }.into(),
        };
        let phis: Vec<_> = std::iter::once(None).chain(phis.iter().map(Some)).collect();
        let poses = vec![RigidMotion::identity(); phis.len()];
        Self {
            rig: StereoRig::new(500.0, (31.5, 23.5), 0.1, (64, 48)).unwrap(),
            rows: phis.iter().enumerate().map(|(k, phi)| row(k, *phi)).collect(),
            truth: Some(poses.clone()),
            poses,
            pictures: Vec::new(),
        }
    }

    pub fn report(&self) -> Report<'_> {
        Report {
            title: "A run".into(),
            source: "somewhere".into(),
            command: "egomotion run somewhere".into(),
            settings_toml: "seed = 1".into(),
            rig: &self.rig,
            frames: &self.rows,
            poses: &self.poses,
            truth: self.truth.as_deref(),
            pictures: &self.pictures,
            stages_ms: vec![("disparity", 12.0), ("flow", 30.0)],
            frame_ms: 45.0,
            notes: Vec::new(),
        }
    }
}

