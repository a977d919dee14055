//! Raw cameras: EuRoC's layout, and calibrations of other formats.

use std::fs;

use crate::process::{assert_refused, egomotion, run, summary, try_run};
use crate::recording::{Copy, FRAMES, drive};

const FIRST_NS: i64 = 1_403_636_592_263_555_584;

/// A raw pair that is rectified but for a right camera that is tilted by `pitch` degrees.
fn rig_toml(pitch: f64) -> String {
    let rig = drive().rig;
    let (sine, cosine) = pitch.to_radians().sin_cos();
    let camera = format!(
        "focal_px = [{0:?}, {0:?}]\ncentre_px = [{1:?}, {2:?}]\n",
        rig.focal_px, rig.cx_px, rig.cy_px
    );
    format!(
        "right_from_left = [1, 0, 0, {:?}, 0, {cosine}, {}, 0, 0, {sine}, {cosine}, 0, 0, 0, 0, 1]\n\
         [left]\n{camera}[right]\n{camera}",
        -rig.baseline_m, -sine
    )
}

/// The recording in EuRoC's layout.
fn euroc() -> Copy {
    let copy = Copy::new();
    let rig = drive().rig;
    for (camera, images, x) in [("cam0", "image_0", 0.0), ("cam1", "image_1", rig.baseline_m)] {
        let folder = copy.file("mav0").join(camera);
        fs::create_dir_all(folder.join("data")).unwrap();
        let mut list = "#timestamp [ns],filename\n".to_owned();
        for k in 0..FRAMES {
            let stamp = FIRST_NS + 100_000_000 * k as i64;
            list += &format!("{stamp},{stamp}.png\n");
            let image = copy.file(&format!("{images}/{k:06}.png"));
            fs::rename(image, folder.join(format!("data/{stamp}.png"))).unwrap();
        }
        fs::write(folder.join("data.csv"), list).unwrap();
        let sensor = format!(
            "T_BS:\n  cols: 4\n  rows: 4\n  data: [1, 0, 0, {x:?}, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n\
             resolution: [320, 240]\ncamera_model: pinhole\nintrinsics: [{0:?}, {0:?}, {1:?}, {2:?}] #fu, fv, cu, cv\n\
             distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n",
            rig.focal_px, rig.cx_px, rig.cy_px
        );
        fs::write(folder.join("sensor.yaml"), sensor).unwrap();
    }
    for name in ["image_0", "image_1"] {
        fs::remove_dir(copy.file(name)).unwrap();
    }
    copy
}

#[test]
fn a_recording_in_eurocs_layout_with_its_truth_and_a_gap() {
    let copy = euroc();
    // The body moves as the left camera, whose poses the recording has; the truth comes twice as often.
    let poses = egomotion_io::trajectory::read(&copy.file("poses.txt"), None).unwrap();
    let mut truth = "#timestamp, p_RS_R_x [m], …\n".to_owned();
    for (k, pose) in poses.iter().enumerate() {
        let (t, q) = (pose.world_from_camera.translation, pose.world_from_camera.quaternion());
        let stamp = FIRST_NS + 100_000_000 * k as i64;
        truth +=
            &format!("{stamp},{:?},{:?},{:?},{:?},{:?},{:?},{:?},0,0,0\n", t.x, t.y, t.z, q.w, q.i, q.j, q.k);
    }
    let place = copy.file("mav0/state_groundtruth_estimate0");
    fs::create_dir(&place).unwrap();
    fs::write(place.join("data.csv"), truth).unwrap();
    let lost = FIRST_NS + 200_000_000;
    fs::remove_file(copy.file(&format!("mav0/cam1/data/{lost}.png"))).unwrap();

    let told = egomotion(["info".as_ref(), copy.source().as_os_str()]).stdout;
    for part in [
        "layout      EuRoC",
        "frames    5 (0 to 4), 1 without a right image",
        "measured, 10.00 Hz",
        "left      raw 320x240 px, f (250.000, 250.000), centre (159.50, 119.50), no distortion",
        "pose      right camera at (0.1600, 0.0000, 0.0000) m",
        "rig       320x240 px, f 250.000 px, baseline 0.1600 m, centre (159.50, 119.50)",
        "truth     poses of 5 frames",
    ] {
        assert!(told.contains(part), "{part:?} is not in\n{told}");
    }
    run(&copy.source(), &copy.out(), "--observe sparse");
    let summary = summary(&copy.out());
    assert_eq!(summary["counts"], serde_json::json!({ "ok": 3, "missing_right": 1 }), "{summary}");
    let error = summary["truth"]["t_rmse_m"].as_f64().unwrap();
    assert!(error < 0.003, "{error} m");
}

#[test]
fn an_ideal_raw_pair_gives_what_the_rectified_one_gives() {
    let copy = Copy::new();
    let file = copy.file("cameras.toml");
    fs::write(&file, rig_toml(0.0)).unwrap();
    run(&copy.source(), &copy.out(), &format!("--observe sparse --calibration {}", file.display()));
    let raw = summary(&copy.out());
    run(&copy.source(), &copy.out(), "--observe sparse");
    let rectified = summary(&copy.out());
    assert!(raw.get("warnings").is_none() && rectified.get("warnings").is_none(), "{raw}");
    let error = |summary: &serde_json::Value| summary["truth"]["t_rmse_m"].as_f64().unwrap();
    assert!((error(&raw) - error(&rectified)).abs() < 1e-4, "{} {}", error(&raw), error(&rectified));
}

#[test]
fn a_wrong_calibration_is_told() {
    let copy = Copy::new();
    let file = copy.file("tilted.toml");
    // 250 px times 0.2° is 0.87 px.
    fs::write(&file, rig_toml(0.2)).unwrap();
    let options = format!("--observe sparse --calibration {}", file.display());
    let ended = run(&copy.source(), &copy.out(), &options);
    assert!(
        ended.stderr.contains("warning: Matches of left and right lie on different rows, by 0."),
        "{}",
        ended.stderr
    );
    let summary = summary(&copy.out());
    let rows = summary["row_disagreement_px"].as_f64().unwrap();
    assert!((rows - 0.87).abs() < 0.1, "{rows} px");
    assert!(summary["warnings"][0].as_str().unwrap().contains(&format!("{rows:.2} px")), "{summary}");
    assert!(fs::read_to_string(copy.out().join("report.html")).unwrap().contains("lie on different rows"));
}

#[test]
fn what_is_missing_is_named() {
    let copy = euroc();
    let refused = |parts: &[&str]| assert_refused(&try_run(&copy.source(), &copy.out(), ""), 1, parts);
    let sensor = copy.file("mav0/cam1/sensor.yaml");
    let good = fs::read_to_string(&sensor).unwrap();
    fs::write(&sensor, good.replace("intrinsics", "intrinsic")).unwrap();
    refused(&["cam1/sensor.yaml", "the key intrinsics is missing", "--calibration FILE"]);
    fs::write(&sensor, good.replace("[320, 240]", "[640, 480]")).unwrap();
    refused(&["sensor.yaml", "the right camera is calibrated for 640x480 pixels, the images have 320x240"]);
    fs::remove_file(&sensor).unwrap();
    refused(&["cam1/sensor.yaml", "--calibration FILE"]);
    fs::write(&sensor, good).unwrap();
    fs::write(copy.file("mav0/cam0/data.csv"), "1403636592263555584 a.png\n").unwrap();
    refused(&["cam0/data.csv:1", "no comma"]);
    fs::remove_dir_all(copy.file("mav0/cam1")).unwrap();
    fs::remove_file(copy.file("mav0/cam0/data.csv")).unwrap();
    refused(&["cam1", "holds no right image"]);
}
