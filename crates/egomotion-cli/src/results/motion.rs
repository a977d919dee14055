//! The trajectory in all formats, and `motion.csv`: one row for each frame from the second on.

use anyhow::Result;
use egomotion::estimate::{CovarianceParts, MotionEstimate};
use egomotion::geometry::{Gaussian, RigCamera, StereoRig};
use egomotion::pipeline::{Config, Observe};
use egomotion_io::motion_table::{self, EstimatedMotion, MotionRow};
use egomotion_io::trajectory::{Pose, write_euroc, write_kitti, write_tum};
use egomotion_io::trajectory_covariance;

use super::folder::ResultFolder;
use super::moving;
use crate::session::{FrameResult, Outcome};

/// A camera of a rig, in whose frame φ is written.
#[derive(Debug, Clone, Copy)]
pub struct Viewpoint<'a> {
    pub rig: &'a StereoRig,
    pub camera: RigCamera,
}

impl Viewpoint<'_> {
    /// The same motion and covariance in the frame of this camera, (4).
    fn of(&self, estimate: &MotionEstimate) -> MotionEstimate {
        match self.camera {
            RigCamera::Left => *estimate,
            camera => estimate.seen_from(&self.rig.centre_from_left(camera)),
        }
    }
}

/// Write the trajectory, `motion.csv`, and where every pixel was seen `moving.csv`; with `parquet` that too.
pub fn write_motion(
    folder: &ResultFolder,
    config: &Config,
    outcome: &Outcome,
    viewpoint: Viewpoint<'_>,
    parquet: bool,
) -> Result<()> {
    write_trajectory(folder, outcome)?;
    if config.observe == Observe::Dense {
        folder.write("moving.csv", moving::table(&outcome.frames)?.as_bytes())?;
    }
    // The first frame has no motion.
    let rows: Vec<MotionRow> =
        outcome.frames.iter().skip(1).map(|frame| motion_row(frame, viewpoint)).collect();
    write_rows(folder, &rows, parquet)
}

fn write_trajectory(folder: &ResultFolder, outcome: &Outcome) -> Result<()> {
    let times = outcome.trajectory.times_s();
    let poses: Vec<Pose> = outcome
        .trajectory
        .poses()
        .iter()
        .zip(times)
        .map(|(pose, &time_s)| Pose { time_s: Some(time_s), world_from_camera: *pose })
        .collect();
    write_tum(&folder.path().join("trajectory_tum.txt"), &poses)?;
    write_kitti(&folder.path().join("trajectory_kitti.txt"), &poses)?;
    write_euroc(&folder.path().join("trajectory_euroc.csv"), &poses)?;
    let frames = outcome.frames.iter().map(|frame| frame.index);
    let covariances = frames.zip(times).zip(outcome.trajectory.covariances_from(0));
    let rows = covariances.map(|((frame, &time_s), cov)| (frame, time_s, cov));
    trajectory_covariance::write(&folder.path().join("trajectory_covariance.csv"), rows)?;
    Ok(())
}

/// Write `motion.csv`, and with `parquet` the same as `motion.parquet`.
pub fn write_rows(folder: &ResultFolder, rows: &[MotionRow], parquet: bool) -> Result<()> {
    motion_table::write(&folder.path().join("motion.csv"), rows)?;
    #[cfg(feature = "parquet")]
    if parquet {
        egomotion_io::motion_parquet::write(&folder.path().join("motion.parquet"), rows)?;
    }
    // Without the feature the option is refused before anything is done.
    #[cfg(not(feature = "parquet"))]
    let _ = parquet;
    Ok(())
}

/// A row of `motion.csv`.
pub fn motion_row(frame: &FrameResult, viewpoint: Viewpoint<'_>) -> MotionRow {
    let motion = &frame.motion;
    let impact = motion.impact();
    MotionRow {
        frame: frame.index,
        time_s: motion.time_s,
        dt_s: motion.dt_s,
        motion: motion.motion.as_ref().ok().map(|left| estimated(left, motion.parts.as_ref(), viewpoint)),
        impact_s: impact.and_then(|impact| {
            let (low, high) = impact.interval95_s()?;
            Some([impact.seconds()?, low, high])
        }),
        status: status(frame).to_owned(),
    }
}

/// φ of a row, from that of the left camera.
fn estimated(
    left: &MotionEstimate,
    parts: Option<&CovarianceParts>,
    viewpoint: Viewpoint<'_>,
) -> EstimatedMotion {
    let whole = viewpoint.of(left);
    let own = |parts: &CovarianceParts| {
        viewpoint.of(&MotionEstimate { theta: Gaussian { cov: parts.own, ..left.theta }, ..*left }).theta.cov
    };
    EstimatedMotion {
        phi: whole.theta,
        own: parts.map(own),
        observed: whole.observed,
        rows: whole.rows,
        inliers: whole.inliers,
    }
}

/// `ok`, `partial`, or why there is no answer.
pub fn status(frame: &FrameResult) -> &'static str {
    match &frame.motion.motion {
        Ok(estimate) if estimate.is_complete() => "ok",
        Ok(_) => "partial",
        Err(why) => why.code(),
    }
}
