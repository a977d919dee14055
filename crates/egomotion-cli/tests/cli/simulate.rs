//! `egomotion simulate`: what it writes is a sequence like any other, and its truth is exact.

use std::fs;
use std::path::{Path, PathBuf};

use egomotion::geometry::Twist;
use egomotion::sim::{Scene, SensorNoise, Sequence};
use egomotion_io::source::Source;
use egomotion_io::{flo, image, pfm, trajectory};
use nalgebra::Vector6;
use tempfile::TempDir;

use crate::process::{Ended, assert_refused, egomotion, names, run, summary};

/// `simulate --out OUT` with options separated by blanks.
fn try_simulate(out: &Path, options: &str) -> Ended {
    let out = ["--out".as_ref(), out.as_os_str()];
    egomotion(
        ["simulate".as_ref()].into_iter().chain(options.split_whitespace().map(AsRef::as_ref)).chain(out),
    )
}

/// The same in a new place `NAME/seq`; it must succeed without a word on standard error.
fn simulate(options: &str) -> (TempDir, PathBuf) {
    let place = TempDir::new().unwrap();
    let out = place.path().join("seq");
    let ended = try_simulate(&out, options);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{options}");
    assert!(ended.stdout.contains(out.to_str().unwrap()), "{}", ended.stdout);
    (place, out)
}

/// Every file of a folder and of those in it, with its content.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for name in names(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            found.extend(
                files(&path).into_iter().map(|(below, content)| (Path::new(&name).join(below), content)),
            );
        } else {
            found.push((name.into(), fs::read(&path).unwrap()));
        }
    }
    found
}

#[test]
fn every_file_is_there() {
    let (_place, out) = simulate("--sequence a --frames 3 --size 48x36");
    let all = |extension: &str| (0..3).map(|k| format!("{k:06}.{extension}")).collect::<Vec<_>>();
    assert_eq!(
        names(&out),
        ["calib.txt", "image_0", "image_1", "poses.txt", "scene.toml", "times.txt", "truth"]
    );
    assert_eq!(
        names(&out.join("truth")),
        ["depth", "depth_velocity", "disparity", "flow", "motion.toml", "trajectory_tum.txt", "visible"]
    );
    for (folder, want) in [
        ("image_0", &all("png")[..]),
        ("image_1", &all("png")),
        ("truth/disparity", &all("pfm")),
        ("truth/depth", &all("pfm")),
        ("truth/visible", &all("png")),
        ("truth/depth_velocity", &all("pfm")[..2]),
        ("truth/flow", &all("flo")[..2]),
    ] {
        assert_eq!(names(&out.join(folder)), want, "{folder}");
    }
}

#[test]
fn rig_poses_motion_and_maps_are_the_exact_ones() {
    let (_place, out) = simulate("--sequence drive --step 2.5 --frames 3 --size 64x48 --noise none");
    let exact = Sequence::named("drive", Some((64, 48)), Some(3), 2.5).unwrap();
    let source = Source::open(&out).unwrap();
    let read = &source.sequences[0];
    let numbers = |rig: &egomotion::geometry::StereoRig| {
        [rig.focal_px, rig.focal_y_px, rig.cx_px, rig.cy_px, rig.doffs_px, rig.baseline_m]
    };
    for (a, b) in numbers(&read.rig.unwrap()).into_iter().zip(numbers(&exact.rig)) {
        assert!((a - b).abs() < 1e-9, "{:?}", read.rig);
    }
    let tum = trajectory::read(&out.join("truth/trajectory_tum.txt"), None).unwrap();
    let motion: toml::Table =
        toml::from_str(&fs::read_to_string(out.join("truth/motion.toml")).unwrap()).unwrap();
    assert_eq!(motion["motion"].as_array().unwrap().len(), 2);
    for (k, frame) in read.frames.iter().enumerate() {
        assert_eq!((frame.time_s, tum[k].time_s), (k as f64, Some(k as f64)));
        let pose = frame.truth.unwrap();
        let apart = pose.inverse().after(&tum[k].world_from_camera).log().vector().norm();
        assert!(apart < 1e-12, "{k} {apart}");
        if k == 0 {
            assert!(pose.log().vector().norm() < 1e-15, "{pose:?}");
            continue;
        }
        let before = read.frames[k - 1].truth.unwrap();
        let phi = pose.inverse().after(&before).log();
        let row = motion["motion"][k - 1].as_table().unwrap();
        let twist = |key: &str| {
            let numbers = row[key].as_array().unwrap().iter().map(|number| number.as_float().unwrap());
            Twist::from_vector(&Vector6::from_iterator(numbers))
        };
        assert_eq!(row["frame"].as_integer(), Some(k as i64));
        assert!((phi.vector() - twist("phi_left").vector()).norm() < 1e-12);
        // Equation (4), and the table's (0, 0, −50) mm and (0.1, 0.3, 0)° times 2.5.
        let cyclopean = twist("phi_cyclopean");
        assert!(
            (cyclopean.seen_from(&exact.rig.left_from_cyclopean()).vector() - phi.vector()).norm() < 1e-12
        );
        let turn = [0.25_f64, 0.75, 0.0].map(f64::to_radians);
        let want = Vector6::new(0.0, 0.0, -0.125, turn[0], turn[1], turn[2]);
        assert!((cyclopean.vector() - want).norm() < 1e-12, "{cyclopean:?}");
    }
    let (view, next) = (exact.view(1).unwrap(), exact.phi(1).unwrap());
    let map = |folder: &str| pfm::read(&out.join(format!("truth/{folder}/000001.pfm"))).unwrap();
    let (disparity, depth, velocity) = (map("disparity"), map("depth"), map("depth_velocity"));
    let [x, y] = flo::read(&out.join("truth/flow/000001.flo")).unwrap();
    let visible = image::read(&out.join("truth/visible/000001.png")).unwrap();
    let left = image::read(&out.join("image_0/000001.png")).unwrap();
    let rendered = view.render(3).left;
    for (u, v) in (0..48).flat_map(|v| (0..64).map(move |u| (u, v))) {
        let point = view.truth_at(u as f64, v as f64).unwrap();
        let moved = view.motion_at(&point, &next);
        let by = moved.displacement_px(&point).unwrap();
        let off = |field: &egomotion::geometry::Field, exact: f64| {
            let found = f64::from(field.get(u, v).unwrap());
            assert!((found - exact).abs() <= 1e-6 * exact.abs().max(1.0), "{u} {v}: {found} {exact}");
        };
        off(&disparity, point.disparity_px());
        off(&depth, point.depth_m());
        off(&velocity, moved.later.z - point.point.z);
        off(&x, by.x);
        off(&y, by.y);
        assert_eq!(visible.at(u, v), f32::from(u8::from(point.in_right) + 2 * u8::from(moved.in_later)));
        assert_eq!(left.at(u, v), rendered.at(u, v).round(), "{u} {v}");
    }
}

#[test]
fn it_is_run_and_judged_like_a_real_sequence() {
    let (place, out) = simulate("--sequence C --frames 4 --seed 3");
    let info = egomotion(["info".as_ref(), out.as_os_str()]);
    for part in [
        "KITTI odometry",
        "frames    4 (0 to 3)",
        "measured, 1.00 Hz",
        "320x240 px, f 416.667 px",
        "poses of 4",
    ] {
        assert!(info.stdout.contains(part), "{part:?} is not in\n{}", info.stdout);
    }
    let results = place.path().join("results");
    run(&out, &results, "--observe sparse");
    let estimate = results.join("trajectory_kitti.txt");
    for truth in ["poses.txt", "truth/trajectory_tum.txt"] {
        let truth = out.join(truth);
        let words = ["evaluate".as_ref(), estimate.as_os_str(), truth.as_os_str(), "--json".as_ref()];
        let report = egomotion(words).json();
        // 0.1 px of a point 2 m away, at f = 416.667 px; the motion is 20 mm and 0.14° a frame.
        assert!(report["t_rmse_m"].as_f64().unwrap() < 0.1 * 2.0 / 416.667, "{report}");
        assert!(report["r_rmse_deg"].as_f64().unwrap() < (0.1_f64 / 416.667).to_degrees(), "{report}");
        assert_eq!(report["frames"], 4);
    }
    assert_eq!(summary(&results)["counts"]["ok"], 3);
}

#[test]
fn seeds_decide_and_threads_do_not() {
    let of = |options: &str| files(&simulate(&format!("--sequence C --frames 2 --size 64x48 {options}")).1);
    let plain = of("--seed 5 --threads 1");
    assert!(plain == of("--seed 5 --threads 2") && plain == of("--seed 5 --noise sensor"));
    let changed = |other: Vec<(PathBuf, Vec<u8>)>| -> Vec<String> {
        assert_eq!(plain.len(), other.len());
        let pairs = plain.iter().zip(other).filter(|(a, b)| **a != *b);
        pairs.map(|((name, _), _)| name.to_str().unwrap().to_owned()).collect()
    };
    let images = ["image_0/000000.png", "image_0/000001.png", "image_1/000000.png", "image_1/000001.png"];
    let with = |last: &str| images.iter().copied().chain([last]).map(String::from).collect::<Vec<_>>();
    // The truth is that of the geometry, whatever the pictures.
    assert_eq!(changed(of("--seed 6")), with("scene.toml"));
    assert_eq!(changed(of("--seed 5 --texture 9")), with("scene.toml"));
    assert_eq!(changed(of("--seed 5 --noise none")), with("scene.toml"));
}

#[test]
fn a_scene_file_gives_scene_rig_and_sensor() {
    let (place, out) = simulate("--sequence C --frames 2 --size 64x48 --seed 4 --texture 8");
    let scene = out.join("scene.toml");
    let text = fs::read_to_string(&scene).unwrap();
    let table: toml::Table = toml::from_str(&text).unwrap();
    let read: Scene = table["scene"].clone().try_into().unwrap();
    assert_eq!(read, Scene::paper_room().with_texture(8));
    let sensor: SensorNoise = table["sensor"].clone().try_into().unwrap();
    assert_eq!(sensor, SensorNoise::default().with_seed(4));
    let again = place.path().join("again");
    let ended = try_simulate(&again, &format!("--sequence C --frames 2 --scene {}", scene.display()));
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(files(&again) == files(&out));
    // Optics that no option has; and refusals, each naming the file.
    let with = |from: &str, to: &str| {
        let file = place.path().join("other.toml");
        assert!(text.contains(from), "{from}");
        fs::write(&file, text.replacen(from, to, 1)).unwrap();
        try_simulate(
            &place.path().join("other"),
            &format!("--sequence C --frames 2 --scene {}", file.display()),
        )
    };
    assert_eq!(with("blur_px = 0.0\nvignetting = 0.0", "blur_px = 1.5\nvignetting = 0.5").code, 0);
    let first = |folder: &str| image::read(&place.path().join(folder).join("image_0/000000.png")).unwrap();
    let corner = |image: &egomotion::geometry::Image| -> f32 { image.row(0)[..8].iter().sum() };
    assert!(corner(&first("other")) < 0.75 * corner(&first("again")));
    let line = text.lines().position(|line| line.starts_with("contrast")).unwrap() + 1;
    let contrast = format!("other.toml:{line}: ");
    for (from, to, parts) in [
        ("blur_px = 0.0", "blur_px = -1.0", &["other.toml: sensor: blur_px -1"][..]),
        ("radius_m = 0.4", "radius_m = 0.0", &["other.toml:", "part 5: the sphere's radius"]),
        ("contrast = 0.3", "contrast = \"much\"", &[&contrast, "invalid type: string"]),
        ("baseline_m = 0.13", "baseline_m = -0.13", &["other.toml: rig: baseline -0.13 m"]),
        ("width_px = 64", "width_px = 640000000", &["other.toml: rig: the size 640000000x48"]),
        ("radius_m = 0.4", "radius_m = 4.0", &["frame 0 of C: a camera is outside the room"]),
    ] {
        assert_refused(&with(from, to), 1, parts);
    }
    let both = format!("--sequence C --size 64x48 --scene {}", scene.display());
    assert_refused(&try_simulate(&place.path().join("both"), &both), 2, &["size: ", "scene.toml has a rig"]);
    let missing = try_simulate(&place.path().join("both"), "--sequence C --scene missing.toml");
    assert_refused(&missing, 1, &["missing.toml: cannot read"]);
    assert!(!place.path().join("both").exists());
}

#[test]
fn a_drive_ends_before_the_wall() {
    let place = TempDir::new().unwrap();
    let ended = try_simulate(place.path(), "--sequence C --step 16 --frames 12 --size 32x24");
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let exact = Sequence::named("C", Some((32, 24)), Some(12), 16.0).unwrap();
    let clear = (0..12).take_while(|&k| exact.clearance_m(k).unwrap() > 0.0).count();
    assert!((2..12).contains(&clear), "{clear}");
    let warning = format!("frame {clear} of C: a camera would leave the room");
    assert!(ended.stderr.contains(&warning), "{warning:?}: {}", ended.stderr);
    assert_eq!(names(&place.path().join("image_0")).len(), clear);
    assert_eq!(names(&place.path().join("truth/flow")).len(), clear - 1);
    let text = fs::read_to_string(place.path().join("times.txt")).unwrap();
    assert_eq!(text.lines().count(), clear);
}

#[test]
fn a_camera_that_turns_away_from_everything_is_told() {
    // 3° a frame: at 180° the two walls of the laboratory are behind, and its table is left.
    let place = TempDir::new().unwrap();
    let ended = try_simulate(place.path(), "--sequence lab-D --step 1.5 --frames 62 --size 16x12");
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(
        ended.stderr.contains("of lab-D: more than a quarter of the image sees no surface"),
        "{}",
        ended.stderr
    );
    assert_eq!(image::read(&place.path().join("truth/visible/000060.png")).unwrap().at(8, 2), 0.0);
}

#[test]
fn what_cannot_be_rendered_is_refused() {
    let place = TempDir::new().unwrap();
    let out = place.path().join("none");
    let names = "known: A, B, C";
    assert_refused(&try_simulate(&out, "--sequence Z"), 2, &["\"Z\"", names, "demo"]);
    assert_refused(&try_simulate(&out, "--sequence C --step 1000"), 2, &["frame 1 of C", "smaller step"]);
    assert_refused(&try_simulate(&out, "--sequence C --step 1e300"), 2, &["frame 1 of C", "smaller step"]);
    for options in [
        "",
        "--sequence C --step -1",
        "--sequence C --step nan",
        "--sequence C --step inf",
        "--sequence C --size 0x240",
        "--sequence C --size 320",
        "--sequence C --size 320x-240",
        "--sequence C --size 100000x100000",
        "--sequence C --size 4294967296x4294967296",
        "--sequence C --frames 0",
        "--sequence C --frames 1",
        "--sequence C --frames 1000001",
        "--sequence C --noise loud",
        "--sequence C --seed -1",
        "--sequence C --seed 18446744073709551615",
        "--sequence C --threads 0",
    ] {
        let ended = try_simulate(&out, options);
        assert_eq!((ended.code, ended.stdout.as_str()), (2, ""), "{options}: {}", ended.stderr);
        assert!(!ended.stderr.is_empty(), "{options}");
    }
    assert!(!out.exists());
}

#[test]
fn places_that_cannot_be_written() {
    let place = TempDir::new().unwrap();
    let small = "--sequence A --frames 2 --size 16x12";
    let file = place.path().join("file");
    fs::write(&file, "mine").unwrap();
    assert_refused(&try_simulate(&file, small), 1, &["image_0: cannot make the folder"]);
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
    let out = place.path().join("out");
    fs::create_dir_all(out.join("truth/depth/000001.pfm")).unwrap();
    assert_refused(&try_simulate(&out, small), 1, &["000001.pfm: cannot replace"]);
}

#[test]
fn a_sequence_replaces_its_own_files_and_no_longer_one() {
    let (_place, out) = simulate("--sequence A --frames 3 --size 16x12");
    fs::write(out.join("notes.txt"), "mine").unwrap();
    let before = files(&out);
    assert_refused(
        &try_simulate(&out, "--sequence A --frames 2 --size 16x12"),
        1,
        &["000002.png: is not of this sequence of 2 frames", "choose another"],
    );
    assert!(files(&out) == before);
    let ended = try_simulate(&out, "--sequence C --frames 4 --size 16x12");
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert_eq!(names(&out.join("truth/flow")).len(), 3);
    assert_eq!(fs::read_to_string(out.join("notes.txt")).unwrap(), "mine");
}

#[cfg(unix)]
#[test]
fn an_interrupted_simulation_leaves_whole_frames() {
    use std::ffi::OsStr;

    use crate::background::Background;
    let place = TempDir::new().unwrap();
    let out = place.path().join("out");
    // More frames than any machine renders until the signal; the still camera never meets a wall.
    let options = ["simulate", "--sequence", "still", "--frames", "5000", "--size", "160x120", "--out"];
    let mut running = Background::begin(options.iter().map(OsStr::new).chain([out.as_os_str()]));
    running.wait_for_file(&out.join("truth/flow/000002.flo"));
    running.interrupt();
    let ended = running.ended();
    assert_eq!(ended.code, 130, "{}", ended.stderr);
    let source = Source::open(&out).unwrap();
    let frames = &source.sequences[0].frames;
    assert!(frames.len() >= 3 && frames.len() < 5000, "{}", frames.len());
    assert!(frames.iter().all(|frame| frame.right.is_some() && frame.truth.is_some()));
    let text = fs::read_to_string(out.join("times.txt")).unwrap();
    assert_eq!(text.lines().count(), frames.len());
    for (path, _) in files(&out) {
        assert!(!path.file_name().unwrap().to_str().unwrap().starts_with('.'), "{path:?}");
    }
}
