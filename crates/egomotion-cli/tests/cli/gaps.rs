//! Bad frames: each keeps its row and its pose, and the next good frame bridges it.

use std::fs;

use egomotion::geometry::Grid;
use egomotion_io::image;

use crate::outputs::{phi, trajectory};
use crate::process::{run, summary};
use crate::recording::{Copy, FRAMES, SIZE, drive};
use crate::table::motion;

/// Spoil frame 2 of five; `observe` sparse or dense.
fn bridged(spoil: impl Fn(&Copy), status: &str, observe: &str) {
    let copy = Copy::new();
    spoil(&copy);
    let ended = run(&copy.source(), &copy.out(), &format!("--observe {observe}"));
    assert!(ended.stderr.contains("frame 2"), "{}", ended.stderr);
    let rows = motion(&copy.out());
    let statuses: Vec<&str> = rows.iter().map(|row| row.status()).collect();
    assert_eq!(statuses, ["ok", status, "ok", "ok"]);
    let (bad, bridge) = (&rows[1], &rows[2]);
    for column in ["tx", "wz", "cov_00", "cov_55", "rows", "inliers", "observed", "impact_s"] {
        assert_eq!(bad.text(column), "", "{column}");
    }
    assert_eq!(bad.frame(), 2);
    // The bridge holds the interval from frame 1 to frame 3.
    assert!((bridge.number("dt_s") - 0.2).abs() < 1e-9 && (rows[3].number("dt_s") - 0.1).abs() < 1e-9);
    let pose = |k: usize| drive().world_from_left(k).unwrap();
    let truth = pose(3).inverse().after(&pose(1)).log();
    let error = phi(bridge).vector() - truth.vector();
    assert!(error.fixed_rows::<3>(0).norm() < 2e-3 && error.fixed_rows::<3>(3).norm() < 1e-3, "{error}");
    // The pose between lies half way of the bridge, and the drive goes on behind it.
    let poses: Vec<_> = trajectory(&copy.out()).iter().map(|pose| pose.world_from_camera).collect();
    assert_eq!(poses.len(), FRAMES);
    let half = poses[1].after(&phi(bridge).scaled(0.5).exp().inverse());
    assert!((poses[2].translation - half.translation).norm() < 1e-9);
    assert!((poses[2].rotation - half.rotation).norm() < 1e-9);
    let end = poses[0].inverse().after(&poses[4]);
    let true_end = pose(0).inverse().after(&pose(4));
    assert!((end.translation - true_end.translation).norm() < 4e-3);
    let counts = &summary(&copy.out())["counts"];
    assert_eq!((&counts["ok"], &counts[status]), (&3.into(), &1.into()));
}

#[test]
fn a_missing_right_image() {
    for observe in ["sparse", "dense"] {
        bridged(|c| fs::remove_file(c.file("image_1/000002.png")).unwrap(), "missing_right", observe);
    }
}

#[test]
fn a_missing_left_image() {
    bridged(|c| fs::remove_file(c.file("image_0/000002.png")).unwrap(), "bad_image", "sparse");
}

#[test]
fn a_file_that_is_cut() {
    let cut = |c: &Copy| {
        let content = fs::read(c.file("image_0/000002.png")).unwrap();
        fs::write(c.file("image_0/000002.png"), &content[..2000]).unwrap();
    };
    for observe in ["sparse", "dense"] {
        bridged(cut, "bad_image", observe);
    }
}

#[test]
fn a_black_image() {
    let black = |c: &Copy| {
        image::write_grey(&c.file("image_1/000002.png"), &Grid::filled(SIZE.0, SIZE.1, 0.0)).unwrap();
    };
    bridged(black, "bad_image", "sparse");
}

#[test]
fn an_image_of_another_size() {
    for (name, size) in [("image_0", (160, 120)), ("image_1", (320, 200))] {
        let other = |c: &Copy| {
            let grey = |u: usize, v: usize| ((u * 7 + v * 13) % 200) as f32;
            let path = c.file(&format!("{name}/000002.png"));
            image::write_grey(&path, &Grid::from_fn(size.0, size.1, grey)).unwrap();
        };
        bridged(other, "bad_image", "sparse");
    }
}

#[test]
fn bad_frames_at_both_ends() {
    let copy = Copy::new();
    fs::remove_file(copy.file("image_1/000000.png")).unwrap();
    fs::remove_file(copy.file("image_1/000004.png")).unwrap();
    run(&copy.source(), &copy.out(), "--observe sparse");
    let rows = motion(&copy.out());
    let statuses: Vec<&str> = rows.iter().map(|row| row.status()).collect();
    // Frame 1 is the first good one: nothing earlier to compare it with.
    assert_eq!(statuses, ["first", "ok", "ok", "missing_right"]);
    assert_eq!(rows[0].text("dt_s"), "");
    let poses = trajectory(&copy.out());
    assert_eq!(poses.len(), FRAMES);
    assert_eq!(poses[1].world_from_camera.translation.norm(), 0.0);
    assert_eq!(poses[4].world_from_camera, poses[3].world_from_camera);
}

#[test]
fn maps_of_a_bridge_are_named_by_its_earlier_frame() {
    let copy = Copy::new();
    fs::remove_file(copy.file("image_1/000001.png")).unwrap();
    run(&copy.source(), &copy.out(), "--frames 3 --maps");
    assert_eq!(crate::process::names(&copy.out().join("disparity")), ["000000.pfm"]);
}
