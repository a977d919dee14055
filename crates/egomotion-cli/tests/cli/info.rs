//! `egomotion info`.

use std::fs;

use crate::process::egomotion;
use crate::recording::{Copy, recording};

fn info(source: &std::path::Path) -> String {
    let ended = egomotion(["info".as_ref(), source.as_os_str()]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    ended.stdout
}

#[test]
fn layout_frames_rig_times_and_truth_are_told() {
    let text = info(recording());
    for part in [
        recording().to_str().unwrap(),
        "KITTI odometry",
        "image_0",
        "sequence    drive",
        "frames    5 (0 to 4)",
        "measured, 10.00 Hz over 0.40 s",
        "320x240 px, f 250.000 px, baseline 0.1600 m, centre (159.50, 119.50), doffs 0.000 px",
        "truth     poses of 5 frames",
    ] {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
}

#[test]
fn what_is_missing_is_told() {
    let copy = Copy::new();
    fs::remove_file(copy.file("times.txt")).unwrap();
    fs::remove_file(copy.file("poses.txt")).unwrap();
    fs::remove_file(copy.file("image_1/000003.png")).unwrap();
    let text = info(&copy.source());
    assert!(text.contains("frames    5 (0 to 4), 1 without a right image"), "{text}");
    assert!(text.contains("assumed, 0.1 s a frame") && !text.contains("truth"), "{text}");
}
