//! `run --frame`: φ and its covariance for a camera of the rig, everything else for the left one.

use std::fs;
use std::path::Path;

use egomotion::geometry::{RigCamera, Twist};
use egomotion_io::motion_table::{self, MotionRow};
use nalgebra::Matrix6;
use tempfile::TempDir;

use crate::outputs::dense_results;
use crate::process::{egomotion, run, summary, try_run};
use crate::recording::{drive, recording};

fn rows(out: &Path) -> Vec<MotionRow> {
    motion_table::read(&out.join("motion.csv")).unwrap()
}

/// φ and covariance of every row are those of the left camera's rows, seen by another by (4).
fn assert_seen_by(camera: RigCamera, found: &[MotionRow], left: &[MotionRow]) {
    let centre = drive().rig.centre_from_left(camera);
    assert_eq!(found.len(), left.len());
    for (found, left) in found.iter().zip(left) {
        assert_eq!((found.frame, found.impact_s, &found.status), (left.frame, left.impact_s, &left.status));
        let (found, left) = (found.motion.as_ref().unwrap(), left.motion.as_ref().unwrap());
        let seen = |phi: &Twist| Twist { t: phi.t + phi.omega.cross(&centre), ..*phi };
        let expected = seen(&Twist::from_vector(&left.phi.mean)).vector();
        assert!((found.phi.mean - expected).amax() < 1e-14, "{camera:?}");
        // (4) is linear: its columns are what it makes of unit motions.
        let by_left =
            Matrix6::from_fn(|i, j| seen(&Twist::from_vector(&nalgebra::Vector6::ith(j, 1.0))).vector()[i]);
        let cov = by_left * left.phi.cov * by_left.transpose();
        assert!((found.phi.cov - cov).amax() < 1e-12 * cov.amax(), "{camera:?}");
        // It is another motion: the robot turns.
        assert!((found.phi.mean - left.phi.mean).amax() > 1e-4);
    }
}

#[test]
fn motion_is_that_of_the_camera_and_all_else_that_of_the_left_one() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("right");
    run(recording(), &out, "--frame right");
    let left = dense_results();
    assert_seen_by(RigCamera::Right, &rows(&out), &rows(left));
    let poses =
        ["tum.txt", "kitti.txt", "euroc.csv", "covariance.csv"].map(|end| format!("trajectory_{end}"));
    for name in poses.into_iter().chain(["moving.csv".into()]) {
        assert_eq!(fs::read(out.join(&name)).unwrap(), fs::read(left.join(&name)).unwrap(), "{name}");
    }
    assert_eq!((&summary(&out)["frame"], &summary(left)["frame"]), (&"right".into(), &"left".into()));
    let page = |out: &Path| fs::read_to_string(out.join("report.html")).unwrap();
    let note = "motion.csv has the right camera";
    assert!(page(&out).contains(note) && !page(left).contains(note));

    // The stated uncertainty is judged against the truth of the same camera: NEES does not depend on which.
    let nees = |out: &Path| {
        let ended =
            egomotion([&"evaluate".into(), &out.to_path_buf(), &recording().into(), &"--json".into()]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        ended.json()["stated"]["nees_over_6"].as_f64().unwrap()
    };
    let (right, left) = (nees(&out), nees(left));
    assert!((right / left - 1.0).abs() < 1e-6, "{right} {left}");
}

#[test]
fn the_cyclopean_camera_is_in_the_middle() {
    let folder = TempDir::new().unwrap();
    let [left, middle] = ["left", "cyclopean"].map(|camera| {
        let out = folder.path().join(camera);
        run(recording(), &out, &format!("--observe sparse --frames 3 --frame {camera}"));
        assert_eq!(summary(&out)["frame"], camera);
        rows(&out)
    });
    assert_seen_by(RigCamera::Cyclopean, &middle, &left);
}

#[test]
fn other_cameras_are_refused() {
    let folder = TempDir::new().unwrap();
    let ended = try_run(recording(), folder.path(), "--frame centre");
    assert_eq!((ended.code, ended.stdout.as_str()), (2, ""));
    assert!(ended.stderr.contains("possible values: left, right, cyclopean"), "{}", ended.stderr);
}
