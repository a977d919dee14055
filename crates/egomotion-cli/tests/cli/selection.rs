//! `--start`, `--frames`, `--stride`, `--reverse`, `--calibration`, `--mask`, `--config`.

use std::fs;

use egomotion::geometry::Grid;
use egomotion::metrics::relative_pose_error;
use egomotion_io::image;
use tempfile::TempDir;

use crate::outputs::{phi, trajectory};
use crate::process::{assert_refused, run, summary, try_run};
use crate::recording::{Copy, SIZE, calibration, drive, recording};
use crate::table::motion;

/// Frames of the rows of a sparse run.
fn frames(options: &str) -> Vec<usize> {
    let out = TempDir::new().unwrap();
    run(recording(), out.path(), &format!("--observe sparse {options}"));
    let rows = motion(out.path());
    assert_eq!(trajectory(out.path()).len(), rows.len() + 1);
    rows.iter().map(|row| row.frame()).collect()
}

#[test]
fn frames_are_chosen_by_start_stride_and_number() {
    assert_eq!(frames(""), [1, 2, 3, 4]);
    assert_eq!(frames("--start 2"), [3, 4]);
    assert_eq!(frames("--frames 3"), [1, 2]);
    assert_eq!(frames("--stride 2"), [2, 4]);
    assert_eq!(frames("--start 1 --stride 2 --frames 2"), [3]);
    assert_eq!(frames("--frames 99"), [1, 2, 3, 4]);
    assert_eq!(frames("--reverse"), [3, 2, 1, 0]);
    assert_eq!(frames("--reverse --start 1 --frames 3"), [2, 1]);
}

#[test]
fn a_choice_without_two_frames_is_refused() {
    let out = TempDir::new().unwrap();
    for (options, part) in [
        ("--frames 1", "motion needs at least two"),
        ("--frames 0", "motion needs at least two"),
        ("--start 4", "motion needs at least two"),
        ("--stride 5", "motion needs at least two"),
        ("--start 5", "past the last of 5 frames"),
    ] {
        assert_refused(&try_run(recording(), &out.path().join("none"), options), 2, &[part]);
    }
    assert!(!out.path().join("none").exists());
}

#[test]
fn a_stride_covers_the_whole_interval() {
    let out = TempDir::new().unwrap();
    run(recording(), out.path(), "--observe sparse --stride 2");
    for (row, k) in motion(out.path()).iter().zip([0, 2]) {
        let true_pose = |k| drive().world_from_left(k).unwrap();
        let truth = true_pose(k + 2).inverse().after(&true_pose(k)).log();
        assert!((row.number("dt_s") - 0.2).abs() < 1e-9);
        let error = phi(row).vector() - truth.vector();
        assert!(error.fixed_rows::<3>(0).norm() < 2e-3 && error.fixed_rows::<3>(3).norm() < 1e-3, "{error}");
    }
}

#[test]
fn backwards_is_the_inverse_with_times_that_increase() {
    let results = ["", "--reverse"].map(|direction| {
        let out = TempDir::new().unwrap();
        run(recording(), out.path(), &format!("--observe sparse {direction}"));
        (motion(out.path()), trajectory(out.path()), summary(out.path()))
    });
    let [(there, ..), (back, poses, summary)] = &results;
    for (a, b) in there.iter().zip(back.iter().rev()) {
        assert!((phi(a).vector() + phi(b).vector()).norm() < 2e-3);
    }
    let times: Vec<f64> = poses.iter().map(|pose| pose.time_s.unwrap()).collect();
    assert!(times.windows(2).all(|t| (t[1] - t[0] - 0.1).abs() < 1e-9), "{times:?}");
    // Judged against the poses played backwards too.
    assert!(summary["truth"]["t_rmse_m"].as_f64().unwrap() < 2e-3);
    let truth: Vec<_> = (0..poses.len()).rev().map(|k| drive().world_from_left(k).unwrap()).collect();
    let estimate: Vec<_> = poses.iter().map(|pose| pose.world_from_camera).collect();
    assert!(relative_pose_error(&estimate, &truth).unwrap().t_rmse_m < 2e-3);
}

#[test]
fn another_calibration_replaces_the_source_s() {
    let copy = Copy::new();
    let f = drive().rig.focal_px;
    let other = copy.file("other.txt");
    fs::write(&other, calibration(f, f, 2.0 * drive().rig.baseline_m)).unwrap();
    // Also where the source has none of its own.
    fs::remove_file(copy.file("calib.txt")).unwrap();
    let options = format!("--observe sparse --frames 3 --calibration {}", other.display());
    run(&copy.source(), &copy.out(), &options);
    for (k, row) in motion(&copy.out()).iter().enumerate() {
        // Twice the baseline makes the same images twice as large a world.
        let error = phi(row).t - 2.0 * drive().phi(k).unwrap().t;
        assert!(error.norm() < 4e-3, "{error}");
    }
}

#[test]
fn masked_pixels_have_no_maps() {
    let copy = Copy::new();
    let mask = copy.file("mask.png");
    let (width, height) = SIZE;
    let white = |v: usize| if v >= 160 { 255.0 } else { 0.0 };
    image::write_grey(&mask, &Grid::from_fn(width, height, |_, v| white(v))).unwrap();
    run(&copy.source(), &copy.out(), &format!("--maps --frames 2 --mask {}", mask.display()));
    let disparity = egomotion_io::pfm::read(&copy.out().join("disparity/000000.pfm")).unwrap();
    let present = |rows: std::ops::Range<usize>| {
        rows.flat_map(|v| (0..width).map(move |u| (u, v)))
            .filter(|&(u, v)| disparity.get(u, v).is_some())
            .count()
    };
    assert_eq!(present(160..height), 0);
    assert!(present(0..160) > width * 160 / 2);
}

#[test]
fn options_come_before_the_file_of_settings() {
    let copy = Copy::new();
    let file = copy.file("settings.toml");
    fs::write(&file, "method = \"dv\"\nestimator = \"ls\"\nseed = 9\n[tracks]\ncorners = 300\n").unwrap();
    let options = format!("--frames 2 --observe sparse --estimator lmeds --config {}", file.display());
    run(&copy.source(), &copy.out(), &options);
    let config = &summary(&copy.out())["config"];
    assert_eq!(
        (&config["method"], &config["estimator"], &config["observe"], &config["seed"]),
        (&"dv".into(), &"lmeds".into(), &"sparse".into(), &9.into())
    );
    assert_eq!(config["tracks"]["corners"], 300);
    // What the file does not name stays at its default.
    assert_eq!(config["approach"], "discrete");
}
