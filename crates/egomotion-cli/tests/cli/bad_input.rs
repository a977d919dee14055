//! Sources that cannot be run: exit code 1 and one line with the file, the reason and what to do.

use std::fs;
use std::path::Path;

use egomotion::geometry::Grid;
use egomotion_io::image;
use tempfile::TempDir;

use crate::process::{assert_refused, egomotion, try_run};
use crate::recording::{Copy, FRAMES, SIZE, calibration, drive};

/// Run the spoilt copy, which must be refused, and leave no folder of results.
fn refused(spoil: impl FnOnce(&Copy), parts: &[&str]) {
    let copy = Copy::new();
    spoil(&copy);
    let ended = try_run(&copy.source(), &copy.out(), "--observe sparse");
    assert_refused(&ended, 1, parts);
    assert!(!copy.out().exists(), "{parts:?}");
    // One line, however the message was put together.
    assert_eq!(ended.stderr.lines().count(), 1, "{}", ended.stderr);
}

/// Run the spoilt copy, none of whose frames can be answered.
fn unanswered(spoil: impl FnOnce(&Copy), status: &str, parts: &[&str]) {
    let copy = Copy::new();
    spoil(&copy);
    for observe in ["sparse", "dense"] {
        let ended = try_run(&copy.source(), &copy.out(), &format!("--observe {observe}"));
        assert_eq!(ended.code, 1, "{}", ended.stderr);
        let line = ended.stderr.lines().last().unwrap();
        assert!(line.contains("no motion could be estimated"), "{line}");
        assert!(parts.iter().all(|part| line.contains(part)), "{parts:?} {line}");
        // What was found out is still written: each frame's status, and a pose for each frame.
        let rows = crate::table::motion(&copy.out());
        assert_eq!(rows.len(), FRAMES - 1);
        assert!(rows.iter().all(|row| row.status() == status && row.text("tx").is_empty()));
        assert_eq!(crate::outputs::trajectory(&copy.out()).len(), FRAMES);
    }
}

fn every_image(copy: &Copy, cameras: &[&str], spoil: impl Fn(&Path)) {
    for camera in cameras {
        (0..FRAMES).for_each(|k| spoil(&copy.file(&format!("{camera}/{k:06}.png"))));
    }
}

#[test]
fn a_folder_that_is_no_source() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let (missing, file) = (folder.path().join("missing"), folder.path().join("file"));
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    fs::write(&file, "x").unwrap();
    assert_refused(&try_run(&missing, &out, ""), 1, &["missing: cannot open", "check the path"]);
    assert_refused(&try_run(&file, &out, ""), 1, &["file: is not a folder", "known layouts"]);
    assert_refused(&try_run(&empty, &out, ""), 1, &["empty: is an empty folder", "known layouts"]);
    assert_refused(&try_run(folder.path(), &out, ""), 1, &["has no layout that is known"]);
    for source in [&missing, &file, &empty] {
        assert_refused(&egomotion(["info".as_ref(), source.as_os_str()]), 1, &[]);
    }
    assert!(!out.exists());
}

#[test]
fn no_images() {
    refused(
        |c| every_image(c, &["image_1"], |f| fs::remove_file(f).unwrap()),
        &["image_1", "no right image"],
    );
    refused(|c| fs::remove_dir_all(c.file("image_1")).unwrap(), &["image_1", "no right image"]);
    refused(|c| every_image(c, &["image_0"], |f| fs::remove_file(f).unwrap()), &["image_0", "no left image"]);
    let one = |c: &Copy| {
        let late = |f: &Path| !f.ends_with("000000.png");
        every_image(c, &["image_0", "image_1"], |f| {
            if late(f) {
                fs::remove_file(f).unwrap()
            }
        });
    };
    refused(one, &["one frame only", "at least two"]);
}

#[test]
fn images_of_which_no_head_can_be_read() {
    let spoil = |c: &Copy| every_image(c, &["image_0", "image_1"], |f| fs::write(f, "no picture").unwrap());
    refused(spoil, &["000000.png"]);
    refused(|c| every_image(c, &["image_0", "image_1"], |f| fs::write(f, "").unwrap()), &["000000.png"]);
}

#[test]
fn a_calibration_that_cannot_measure() {
    let (f, b) = (drive().rig.focal_px, drive().rig.baseline_m);
    let text = |text: String| move |c: &Copy| fs::write(c.file("calib.txt"), text).unwrap();
    refused(|c| fs::remove_file(c.file("calib.txt")).unwrap(), &["calib.txt: cannot read", "check the path"]);
    refused(text(String::new()), &["calib.txt", "the key P0", "is missing"]);
    refused(text(calibration(f, f, 0.0)), &["calib.txt:2", "baseline 0 m is not positive"]);
    refused(text(calibration(f, f, -b)), &["calib.txt:2", "is not positive", "swapped"]);
    refused(text(calibration(0.0, 0.0, b)), &["calib.txt:2", "focal length 0 px is not positive"]);
    refused(text(calibration(-f, -f, b)), &["calib.txt:2", "focal length", "is not positive"]);
    refused(text(calibration(f, 2.0 * f, b)), &["calib.txt", "rectified"]);
    refused(text(calibration(f, f, f64::NAN)), &["calib.txt:2: P1: \"NaN\" is not a finite number"]);
    refused(text(calibration(f64::NAN, f, b)), &["calib.txt:1: P0: \"NaN\" is not a finite number"]);
    refused(text(calibration(f, f, f64::INFINITY)), &["calib.txt:2: P1", "is not a finite number"]);
    refused(text("P0: 1 2 3\n".into()), &["calib.txt:1: P0: 3 numbers, not 12"]);
    let bytes = |c: &Copy| fs::write(c.file("calib.txt"), [0xff, 0xfe, 0x00]).unwrap();
    refused(bytes, &["calib.txt", "is not a text file"]);
}

#[test]
fn a_calibration_given_by_name_is_read_in_place_of_the_source_s() {
    let copy = Copy::new();
    let none = copy.file("none.txt");
    let ended = try_run(&copy.source(), &copy.out(), &format!("--calibration {}", none.display()));
    assert_refused(&ended, 1, &["none.txt: cannot read"]);
}

#[test]
fn time_stamps_that_do_not_increase() {
    let times = |text: &'static str| move |c: &Copy| fs::write(c.file("times.txt"), text).unwrap();
    refused(times("0\n0.1\n0.1\n0.3\n0.4\n"), &["times.txt:3", "does not come after", "increase"]);
    refused(times("0\n0.1\n0.05\n0.3\n0.4\n"), &["times.txt:3", "does not come after"]);
    refused(times("0\n0.1\nnan\n0.3\n0.4\n"), &["times.txt:3", "not a finite number"]);
    refused(times("0\n0.1\n"), &["times.txt:3", "ends after 2 time stamps"]);
    refused(times("0\n0.1\nx\n0.3\n0.4\n"), &["times.txt:3", "\"x\" is not a number"]);
}

#[test]
fn poses_that_are_none() {
    refused(|c| fs::write(c.file("poses.txt"), "1 2 3\n").unwrap(), &["poses.txt:1", "3 numbers, not 12"]);
}

#[test]
fn a_mask_that_does_not_fit() {
    let copy = Copy::new();
    let small = copy.file("small.png");
    image::write_grey(&small, &Grid::filled(SIZE.0 - 1, SIZE.1, 0.0)).unwrap();
    let with = |name: &str| {
        let mask = copy.file(name);
        try_run(&copy.source(), &copy.out(), &format!("--mask {}", mask.display()))
    };
    assert_refused(&with("small.png"), 1, &["small.png: the mask is 319x240", "320x240"]);
    assert_refused(&with("none.png"), 1, &["none.png: cannot read"]);
    assert_refused(&with("calib.txt"), 1, &["calib.txt", "PNG"]);
    assert!(!copy.out().exists());
}

#[test]
fn a_mask_over_everything_leaves_too_few_rows() {
    let copy = Copy::new();
    let mask = copy.file("mask.png");
    image::write_grey(&mask, &Grid::filled(SIZE.0, SIZE.1, 255.0)).unwrap();
    for observe in ["dense", "sparse"] {
        let options = format!("--frames 2 --observe {observe} --mask {}", mask.display());
        let ended = try_run(&copy.source(), &copy.out(), &options);
        assert_eq!(ended.code, 1, "{}", ended.stderr);
        assert!(ended.stderr.lines().last().unwrap().contains("no motion could be estimated"));
        assert_eq!(crate::table::motion(&copy.out())[0].status(), "few_rows");
    }
}

#[test]
fn images_without_content() {
    for grey in [0.0, 127.0, 255.0] {
        let flat = |f: &Path| image::write_grey(f, &Grid::filled(SIZE.0, SIZE.1, grey)).unwrap();
        unanswered(|c| every_image(c, &["image_0", "image_1"], flat), "bad_image", &["image is constant"]);
    }
}

#[test]
fn images_that_are_cut() {
    let cut = |f: &Path| {
        let content = fs::read(f).unwrap();
        fs::write(f, &content[..content.len() / 2]).unwrap();
    };
    unanswered(|c| every_image(c, &["image_0", "image_1"], cut), "bad_image", &["image_0", ".png"]);
    unanswered(|c| every_image(c, &["image_1"], cut), "bad_image", &["image_1", ".png"]);
}

#[test]
fn left_and_right_of_different_size() {
    let smaller = |f: &Path| {
        let image = image::read(f).unwrap();
        image::write_grey(f, &Grid::from_fn(300, 240, |u, v| image.at(u, v))).unwrap();
    };
    let parts = ["image_1", "300x240", "320x240"];
    unanswered(|c| every_image(c, &["image_1"], smaller), "bad_image", &parts);
}

#[test]
fn images_that_show_different_things() {
    // Noise without anything in common between left, right, before and after.
    let noise = |f: &Path| {
        let seed = f.to_string_lossy().bytes().fold(7_u64, |s, b| s.wrapping_mul(31).wrapping_add(b.into()));
        let grey = |u: usize, v: usize| {
            let mixed = (seed ^ ((u as u64) << 32 | v as u64)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 56) as f32
        };
        image::write_grey(f, &Grid::from_fn(SIZE.0, SIZE.1, grey)).unwrap();
    };
    for observe in ["sparse", "dense"] {
        let copy = Copy::new();
        every_image(&copy, &["image_0", "image_1"], noise);
        let ended = try_run(&copy.source(), &copy.out(), &format!("--frames 3 --observe {observe}"));
        assert_eq!(ended.code, 1, "{observe}: {}", ended.stderr);
        assert!(crate::table::motion(&copy.out()).iter().all(|row| row.text("tx").is_empty()));
    }
}
