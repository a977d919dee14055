//! Recognition of folders, and what is said about those that are incomplete or wrong.
use std::fs;
use std::path::Path;

use egomotion::geometry::Grid;
use egomotion_io::source::{Clock, DatasetLayout};
use egomotion_io::{Source, image};
use nalgebra::Vector3;
use tempfile::TempDir;

const CALIBRATION: &str = "P0: 50 0 4 0 0 50 3 0 0 0 1 0\nP1: 50 0 4 -25 0 50 3 0 0 0 1 0\n\
                           P2: 50 0 4 3 0 50 3 0 0 0 1 0\nP3: 50 0 4 -22 0 50 3 0 0 0 1 0\n";

fn picture(root: &Path, name: &str) {
    let path = root.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::write_grey(&path, &Grid::from_fn(8, 6, |u, v| (u * v) as f32)).unwrap();
}

/// A sequence with `count` pairs in image_`left`, image_`right`.
fn sequence(left: usize, right: usize, count: usize) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for k in 0..count {
        picture(folder.path(), &format!("image_{left}/{k:06}.png"));
        picture(folder.path(), &format!("image_{right}/{k:06}.png"));
    }
    fs::write(folder.path().join("calib.txt"), CALIBRATION).unwrap();
    folder
}

fn refused(folder: &Path) -> String {
    Source::open(folder).unwrap_err().to_string()
}

#[test]
fn without_times_they_are_assumed_and_it_says_so() {
    let folder = sequence(0, 1, 3);
    let source = Source::open(folder.path()).unwrap();
    assert_eq!(source.layout, DatasetLayout::KittiOdometry);
    assert!(source.reason.contains("image_0 and image_1"));
    let sequence = &source.sequences[0];
    assert_eq!(sequence.clock, Clock::Assumed { interval_s: 0.1 });
    assert_eq!(sequence.clock.to_string(), "assumed, 0.1 s a frame");
    assert_eq!(sequence.frames.iter().map(|f| f.time_s).collect::<Vec<_>>(), [0.0, 0.1, 0.2]);
    assert_eq!(sequence.rig.unwrap().baseline_m, 0.5);
    assert_eq!((sequence.rig.unwrap().width_px, sequence.rig.unwrap().height_px), (8, 6));
}

#[test]
fn a_lost_image_leaves_its_frame_in_place() {
    let folder = sequence(0, 1, 4);
    let lost = |name: &str| fs::remove_file(folder.path().join(name)).unwrap();
    lost("image_1/000001.png");
    lost("image_0/000002.png");
    fs::write(folder.path().join("image_0/.000009.png"), "not an image").unwrap();
    fs::write(folder.path().join("image_0/notes.txt"), "not an image").unwrap();
    let frames = Source::open(folder.path()).unwrap().sequences.remove(0).frames;
    assert_eq!(frames.iter().map(|f| f.right.is_some()).collect::<Vec<_>>(), [true, false, true, true]);
    let error = image::read(&frames[2].left).unwrap_err().to_string();
    assert!(error.contains("000002.png: cannot read"), "{error}");
    // Both images of a frame are lost: time and pose of the others stay theirs.
    lost("image_1/000002.png");
    fs::write(folder.path().join("times.txt"), "0\n0.5\n1\n1.5\n").unwrap();
    let row = |x: f64| format!("1 0 0 {x} 0 1 0 0 0 0 1 0\n");
    fs::write(folder.path().join("poses.txt"), (0..4).map(|k| row(f64::from(k))).collect::<String>())
        .unwrap();
    let frames = Source::open(folder.path()).unwrap().sequences.remove(0).frames;
    assert_eq!(
        frames.iter().map(|f| (f.index, f.time_s)).collect::<Vec<_>>(),
        [(0, 0.0), (1, 0.5), (3, 1.5)]
    );
    assert_eq!(frames[2].truth.unwrap().translation, Vector3::new(3.0, 0.0, 0.0));
}

#[test]
fn a_cut_recording_keeps_rows_and_images_together() {
    // Images 5 … 7 with three rows: row by row. With more rows: by number.
    let folder = sequence(0, 1, 8);
    for k in 0..5 {
        fs::remove_file(folder.path().join(format!("image_0/{k:06}.png"))).unwrap();
        fs::remove_file(folder.path().join(format!("image_1/{k:06}.png"))).unwrap();
    }
    let times = |rows: usize| {
        let text: String = (0..rows).map(|k| format!("{}\n", 10 + k)).collect();
        fs::write(folder.path().join("times.txt"), text).unwrap();
        Source::open(folder.path())
            .map(|s| s.sequences[0].frames.iter().map(|f| f.time_s).collect::<Vec<_>>())
    };
    assert_eq!(times(3).unwrap(), [10.0, 11.0, 12.0]);
    assert_eq!(times(8).unwrap(), [15.0, 16.0, 17.0]);
    let error = times(7).unwrap_err().to_string();
    assert!(error.contains("times.txt:8: ends after 7 time stamps, image 7 has none"), "{error}");
}

#[test]
fn wrong_times_are_named_by_line() {
    let folder = sequence(0, 1, 3);
    let said = |text: &str| {
        fs::write(folder.path().join("times.txt"), text).unwrap();
        refused(folder.path())
    };
    assert!(said("0\n0.1\n").contains("times.txt:3: ends after 2 time stamps, image 2 has none"));
    assert!(said("").contains("times.txt:1: ends after 0"));
    assert!(said("0\nsoon\n0.2\n").contains("times.txt:2: \"soon\" is not a number"));
    assert!(said("0\n0.1\nNaN\n").contains("times.txt:3: \"NaN\" is not a finite number"));
    assert!(said("0\n0.1\n0.1\n").contains("times.txt:3: time 0.1 s does not come after 0.1 s"));
}

#[test]
fn poses_of_sequences_stand_beside_and_are_moved_to_the_left_camera() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("sequences/07");
    picture(&folder, "image_2/000000.png");
    picture(&folder, "image_3/000000.png");
    fs::write(folder.join("calib.txt"), CALIBRATION).unwrap();
    fs::create_dir(root.path().join("poses")).unwrap();
    // Turned by a quarter about Y: the camera's X is the world's −Z.
    fs::write(root.path().join("poses/07.txt"), "0 0 1 5 0 1 0 6 -1 0 0 7\n").unwrap();
    let source = Source::open(&folder).unwrap();
    let sequence = &source.sequences[0];
    assert_eq!((sequence.name.as_str(), sequence.rig.unwrap().baseline_m), ("07", 0.5));
    // Camera 2 stands at x = −3/50 of camera 0, which is +0.06 along the world's Z.
    let truth = sequence.frames[0].truth.unwrap();
    assert!((truth.translation - Vector3::new(5.0, 6.0, 7.06)).norm() < 1e-12);
}

#[test]
fn grey_goes_before_colour_unless_its_right_images_are_missing() {
    let folder = sequence(0, 1, 1);
    picture(folder.path(), "image_2/000000.png");
    picture(folder.path(), "image_3/000000.png");
    let left = || Source::open(folder.path()).unwrap().sequences[0].frames[0].left.clone();
    assert!(left().to_string_lossy().contains("image_0"));
    fs::remove_dir_all(folder.path().join("image_1")).unwrap();
    assert!(left().to_string_lossy().contains("image_2"));
}

#[test]
fn incomplete_and_unknown_folders_are_refused_with_what_to_do() {
    let folder = sequence(0, 1, 2);
    fs::remove_dir_all(folder.path().join("image_1")).unwrap();
    assert!(refused(folder.path()).contains("image_1: holds no right image"));
    fs::create_dir(folder.path().join("image_1")).unwrap();
    assert!(refused(folder.path()).contains("image_1: holds no right image"));

    let folder = sequence(0, 1, 2);
    fs::remove_file(folder.path().join("calib.txt")).unwrap();
    assert!(refused(folder.path()).contains("calib.txt: cannot read"));
    let other = tempfile::tempdir().unwrap();
    fs::write(other.path().join("mine.txt"), CALIBRATION.replace("-25", "-50")).unwrap();
    let source = Source::open_with(folder.path(), Some(&other.path().join("mine.txt"))).unwrap();
    assert_eq!(source.sequences[0].rig.unwrap().baseline_m, 1.0);

    let empty = tempfile::tempdir().unwrap();
    let error = refused(empty.path());
    assert!(error.contains("is an empty folder; known layouts: KITTI odometry"), "{error}");
    fs::write(empty.path().join("a.txt"), "").unwrap();
    assert!(refused(empty.path()).contains("has no layout that is known; known layouts"));
    assert!(refused(&empty.path().join("a.txt")).contains("is not a folder"));
    assert!(refused(&empty.path().join("none")).contains("none: cannot open"));
}

#[test]
fn scenes_are_independent_sequences() {
    let root = tempfile::tempdir().unwrap();
    let training = root.path().join("training");
    for name in ["000004_10", "000004_11", "000011_10", "000011_11"] {
        picture(&training, &format!("image_0/{name}.png"));
        picture(&training, &format!("image_1/{name}.png"));
    }
    fs::remove_file(training.join("image_1/000011_11.png")).unwrap();
    picture(&training, "flow_occ/000011_10.png");
    assert!(refused(root.path()).contains("000004.txt: cannot read"));
    fs::create_dir(training.join("calib")).unwrap();
    for scene in ["000004", "000011"] {
        fs::write(training.join(format!("calib/{scene}.txt")), CALIBRATION).unwrap();
    }
    let source = Source::open(root.path()).unwrap();
    assert!(source.layout == DatasetLayout::KittiStereoFlow2012 && source.layout.is_scene_set());
    assert!(source.reason.contains("training/image_0"), "{}", source.reason);
    let [first, second] = &source.sequences[..] else { panic!("{:?}", source.sequences) };
    assert_eq!((first.name.as_str(), second.name.as_str()), ("000004", "000011"));
    assert_eq!(first.truth_files, None);
    assert!(second.truth_files.as_ref().unwrap().flow.is_some());
    assert!(second.frames[1].right.is_none() && second.frames[1].time_s == 0.1);
}

#[test]
fn a_broken_first_image_does_not_stop_the_opening() {
    let folder = sequence(0, 1, 2);
    fs::write(folder.path().join("image_0/000000.png"), "cut").unwrap();
    assert!(Source::open(folder.path()).is_ok());
    for name in ["image_0/000001.png", "image_1/000000.png", "image_1/000001.png"] {
        fs::write(folder.path().join(name), "cut").unwrap();
    }
    assert!(refused(folder.path()).contains("000000.png: is not a whole PNG image"));
}

/// A raw drive of three pairs: east by one hundred-thousandth of a degree a frame, turning left about the vertical.
fn raw_drive() -> TempDir {
    let day = tempfile::tempdir().unwrap();
    let drive = day.path().join("drive_0001_sync");
    for k in 0..3 {
        picture(&drive, &format!("image_00/data/{k:010}.png"));
        picture(&drive, &format!("image_01/data/{k:010}.png"));
        let oxts = drive.join("oxts/data");
        fs::create_dir_all(&oxts).unwrap();
        let (longitude, yaw) = (8.4 + 1e-5 * f64::from(k), 0.01 * f64::from(k));
        fs::write(oxts.join(format!("{k:010}.txt")), format!("0 {longitude} 110.5 0 0 {yaw} 0 0 0\n"))
            .unwrap();
    }
    let stamps = "2011-09-26 13:02:25.951199337\n2011-09-26 13:02:26.054847\n2011-09-26 13:02:26.15\n";
    fs::write(drive.join("image_00/timestamps.txt"), stamps).unwrap();
    let rectified = CALIBRATION.replace('P', "P_rect_0") + "R_rect_00: 1 0 0 0 1 0 0 0 1\n";
    fs::write(day.path().join("calib_cam_to_cam.txt"), rectified).unwrap();
    // The laser's axes are those of the inertial system, one metre ahead of it; the camera looks ahead.
    let calibration = |name: &str, text: &str| fs::write(day.path().join(name), text).unwrap();
    calibration("calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 1\nT: -1 0 0\n");
    calibration("calib_velo_to_cam.txt", "R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 0\n");
    day
}

#[test]
fn a_raw_drive_has_time_stamps_and_the_poses_of_its_inertial_system() {
    let day = raw_drive();
    let source = Source::open(&day.path().join("drive_0001_sync")).unwrap();
    assert_eq!(source.layout, DatasetLayout::KittiRaw);
    let sequence = &source.sequences[0];
    assert_eq!((sequence.name.as_str(), sequence.clock), ("drive_0001_sync", Clock::Measured));
    assert_eq!(sequence.rig.unwrap().baseline_m, 0.5);
    let times: Vec<f64> = sequence.frames.iter().map(|f| f.time_s).collect();
    assert_eq!(times[0], 0.0);
    assert!((times[1] - 0.103647663).abs() < 1e-4 && (times[2] - 0.198800663).abs() < 1e-4, "{times:?}");
    let pose = |k: usize| sequence.frames[k].truth.unwrap();
    let step = pose(0).inverse().after(&pose(1));
    // East is ahead: depth grows by the step, and by nothing that the turn about the inertial system adds to it.
    let metre = 6_378_137.0 * 1e-5_f64.to_radians();
    let (sin, cos) = 0.01_f64.sin_cos();
    let expected = Vector3::new(-sin, 0.0, metre + cos - 1.0);
    assert!((step.translation - expected).norm() < 1e-6, "{} {expected}", step.translation);
    assert!((step.rotation[(2, 0)] - sin).abs() < 1e-9, "{}", step.rotation);
    // Without the way to the inertial system there is no truth; without stamps no drive.
    fs::remove_file(day.path().join("calib_imu_to_velo.txt")).unwrap();
    let drive = day.path().join("drive_0001_sync");
    assert!(Source::open(&drive).unwrap().sequences[0].frames[0].truth.is_none());
    fs::write(drive.join("image_00/timestamps.txt"), "2011-09-26 13:02:25.9\nnoon\n").unwrap();
    assert!(
        refused(&drive).contains("timestamps.txt:2: \"noon\" is not a time stamp"),
        "{}",
        refused(&drive)
    );
    fs::write(drive.join("image_00/timestamps.txt"), "2011-09-26 13:02:25.9\n").unwrap();
    assert!(refused(&drive).contains("image 1 has none"), "{}", refused(&drive));
}
