//! What a run leaves behind: files, rows, poses, summary, and what it says.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use assert_cmd::cargo::cargo_bin_cmd;
use egomotion::geometry::Twist;
use egomotion_io::trajectory::{Pose, TrajectoryFormat, read};
use tempfile::TempDir;

use crate::process::{Ended, names, run, summary};
use crate::recording::{FRAMES, SIZE, drive, recording};
use crate::table::{COLUMNS, Row, motion};

/// The results of one dense run with maps over the whole recording, which several tests look at.
pub fn dense_results() -> &'static Path {
    static OUT: OnceLock<PathBuf> = OnceLock::new();
    OUT.get_or_init(|| {
        let out = recording().with_file_name("dense");
        let _ = fs::remove_dir_all(&out);
        run(recording(), &out, "--maps --threads 2");
        out
    })
}

/// φ of a row, as a twist.
pub fn phi(row: &Row) -> Twist {
    let [a, b, c, d, e, f] = row.phi();
    Twist { t: [a, b, c].into(), omega: [d, e, f].into() }
}

/// The trajectory of a folder of results; both files must say the same.
pub fn trajectory(out: &Path) -> Vec<Pose> {
    let tum = read(&out.join("trajectory_tum.txt"), Some(TrajectoryFormat::Tum)).unwrap();
    let kitti = read(&out.join("trajectory_kitti.txt"), Some(TrajectoryFormat::Kitti)).unwrap();
    assert_eq!(tum.len(), kitti.len());
    for (a, b) in tum.iter().zip(&kitti) {
        let (a, b) = (a.world_from_camera, b.world_from_camera);
        assert!((a.rotation - b.rotation).amax() < 1e-12 && (a.translation - b.translation).amax() < 1e-12);
    }
    tum
}

#[test]
fn motion_csv_has_the_columns_of_the_contract() {
    let text = fs::read_to_string(dense_results().join("motion.csv")).unwrap();
    let own: String = (0..6).flat_map(|i| (i..6).map(move |j| format!(",own_{i}{j}"))).collect();
    assert_eq!(text.lines().next(), Some(format!("{COLUMNS}{own}").as_str()));
    assert_eq!(text.lines().count(), FRAMES);
    assert!(text.ends_with('\n'));
}

#[test]
fn moving_csv_lists_groups_by_frame() {
    let mut reader = csv::Reader::from_path(dense_results().join("moving.csv")).unwrap();
    let head: Vec<String> = reader.headers().unwrap().iter().map(String::from).collect();
    assert_eq!(
        head.join(","),
        "frame,group,u,v,width,height,pixels,depth_m,tx,ty,tz,wx,wy,wz,\
         sigma_tx,sigma_ty,sigma_tz,sigma_wx,sigma_wy,sigma_wz,vz,vz_sigma,impact_s,impact_lo_s,impact_hi_s"
    );
    for record in reader.records() {
        let record = record.unwrap();
        let whole = |i: usize| record[i].parse::<usize>().unwrap();
        assert!((1..FRAMES).contains(&whole(0)));
        assert!(whole(2) + whole(4) <= SIZE.0 && whole(3) + whole(5) <= SIZE.1, "{record:?}");
        assert!(record[7].parse::<f64>().unwrap() > 0.0 && record[21].parse::<f64>().unwrap() > 0.0);
        // φ and its σ are known together.
        assert!((8..14).all(|i| record[i].is_empty() == record[i + 6].is_empty()));
    }
}

#[test]
fn intervals_without_an_obstacle_are_counted_by_reason() {
    let rows = motion(dense_results());
    let none = rows.iter().filter(|row| row.text("impact_s").is_empty()).count();
    let reasons = summary(dense_results())["no_obstacle"].as_object().unwrap().clone();
    let counted: u64 = reasons.values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(counted, none as u64, "{reasons:?}");
}

#[test]
fn every_row_answers_near_the_truth() {
    let rows = motion(dense_results());
    for (k, row) in rows.iter().enumerate() {
        assert_eq!((row.frame(), row.status(), row.text("observed")), (k + 1, "ok", "111111"));
        assert!((row.number("time_s") - (100.1 + 0.1 * k as f64)).abs() < 1e-9);
        assert!((row.number("dt_s") - 0.1).abs() < 1e-9);
        // The robot drives about 50 mm and turns up to a degree: an error of the sign, the unit, the
        // frame or the order of φ exceeds a millimetre or a twentieth of a degree.
        let error = phi(row).vector() - drive().phi(k).unwrap().vector();
        assert!(error.fixed_rows::<3>(0).norm() < 1e-3, "{k}: {error}");
        assert!(error.fixed_rows::<3>(3).norm().to_degrees() < 0.05, "{k}: {error}");
        for i in 0..6 {
            let sigma = row.number(&format!("cov_{i}{i}")).sqrt();
            assert!(sigma > 0.0 && sigma < 1e-3, "{i}: {sigma}");
        }
        let (rows, inliers) = (row.number("rows"), row.number("inliers"));
        assert!(6.0 < inliers && inliers <= rows, "{inliers} of {rows}");
    }
}

#[test]
fn there_is_a_pose_for_each_frame_and_it_follows_from_motion_csv() {
    let poses = trajectory(dense_results());
    assert_eq!(poses.len(), FRAMES);
    let first = poses[0].world_from_camera;
    assert_eq!((first.translation.norm(), (first.rotation.trace() - 3.0).abs()), (0.0, 0.0));
    let mut pose = first;
    for (k, row) in motion(dense_results()).iter().enumerate() {
        // The scene moves by exp φ, the camera by its inverse.
        pose = pose.after(&phi(row).exp().inverse());
        let written = poses[k + 1];
        assert!((written.world_from_camera.translation - pose.translation).norm() < 1e-9);
        assert!((written.world_from_camera.rotation - pose.rotation).norm() < 1e-9);
        assert_eq!(written.time_s, Some(row.number("time_s")));
    }
}

#[test]
fn summary_has_the_keys_of_the_contract() {
    let summary = summary(dense_results());
    for key in [
        "version",
        "source",
        "frames",
        "complete",
        "rig",
        "config",
        "seed",
        "counts",
        "stages_ms",
        "frame_ms",
        "wall_s",
    ] {
        assert!(!summary[key].is_null(), "{key} is missing from {summary}");
    }
    assert_eq!(summary["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(summary["source"], recording().display().to_string());
    assert_eq!((&summary["frames"], &summary["complete"]), (&FRAMES.into(), &true.into()));
    assert_eq!(summary["counts"], serde_json::json!({ "ok": FRAMES - 1 }));
    assert_eq!((&summary["rig"]["width_px"], &summary["rig"]["height_px"]), (&SIZE.0.into(), &SIZE.1.into()));
    assert_eq!(
        (&summary["config"]["method"], &summary["config"]["observe"]),
        (&"ml".into(), &"dense".into())
    );
    for stage in ["decode", "disparity", "flow", "tracks", "estimate", "maps"] {
        assert!(summary["stages_ms"][stage].as_f64().unwrap() > 0.0, "{stage}");
    }
    assert!(summary["frame_ms"].as_f64().unwrap() > 0.0 && summary["wall_s"].as_f64().unwrap() > 0.0);
    // The recording has poses, so it is judged.
    assert!(summary["truth"]["t_rmse_m"].as_f64().unwrap() < 1e-3);
    assert_eq!(summary["truth"]["components"], 6 * (FRAMES - 1));
}

#[test]
fn without_maps_only_the_files_of_the_contract_appear() {
    let out = TempDir::new().unwrap();
    let ended = run(recording(), out.path(), "--frames 2 --observe sparse");
    let mut expected = vec![
        "motion.csv",
        "summary.json",
        "trajectory_covariance.csv",
        "trajectory_euroc.csv",
        "trajectory_kitti.txt",
        "trajectory_tum.txt",
    ];
    if out.path().join("report.html").exists() {
        expected.insert(1, "report.html");
    }
    assert_eq!(names(out.path()), expected);
    // Results on standard output; in a pipe there is no progress, so nothing is left for standard error.
    assert!(ended.stdout.contains("1 of 1 motions answered"), "{}", ended.stdout);
    assert_eq!(ended.stderr, "");
}

#[test]
fn results_go_to_a_folder_of_the_source_s_name() {
    let place = TempDir::new().unwrap();
    // The name is that of the folder itself, however the path ends.
    for source in [recording().to_owned(), recording().join("image_0").join("..")] {
        let output = cargo_bin_cmd!("egomotion")
            .current_dir(place.path())
            .arg("run")
            .arg(source)
            .args(["--frames", "2", "--observe", "sparse"])
            .output();
        let ended = Ended::of(output.unwrap());
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        assert_eq!(names(place.path()), ["egomotion-out"]);
        assert_eq!(names(&place.path().join("egomotion-out")), ["drive"]);
        assert_eq!(summary(&place.path().join("egomotion-out").join("drive"))["frames"], 2);
        fs::remove_dir_all(place.path().join("egomotion-out")).unwrap();
    }
}

#[test]
fn json_on_standard_output_is_the_summary() {
    let out = TempDir::new().unwrap();
    let ended = run(recording(), out.path(), "--frames 2 --observe sparse --json");
    assert_eq!(ended.json(), summary(out.path()));
}

#[test]
fn a_rerun_replaces_our_files_and_leaves_others() {
    let out = TempDir::new().unwrap();
    let path = |name: &str| out.path().join(name);
    fs::write(path("notes.txt"), "mine").unwrap();
    fs::create_dir(path("disparity")).unwrap();
    fs::write(path("disparity").join("mine.pfm"), "mine").unwrap();
    fs::write(path("motion.csv"), "old").unwrap();
    run(recording(), out.path(), "--observe sparse");
    assert_eq!(motion(out.path()).len(), FRAMES - 1);
    run(recording(), out.path(), "--observe sparse --frames 3");
    assert_eq!((motion(out.path()).len(), trajectory(out.path()).len()), (2, 3));
    assert_eq!(summary(out.path())["frames"], 3);
    assert_eq!(fs::read_to_string(path("notes.txt")).unwrap(), "mine");
    assert_eq!(fs::read_to_string(path("disparity").join("mine.pfm")).unwrap(), "mine");
    assert!(names(out.path()).iter().all(|name| !name.starts_with('.')));
}

#[test]
fn a_result_does_not_depend_on_the_number_of_threads() {
    for options in ["--frames 3", "--frames 3 --observe sparse", "--frames 3 --method dv --estimator lmeds"] {
        let tables = ["--threads 1", "--threads 2"].map(|threads| {
            let out = TempDir::new().unwrap();
            run(recording(), out.path(), &format!("{options} {threads}"));
            fs::read_to_string(out.path().join("motion.csv")).unwrap()
        });
        assert_eq!(tables[0], tables[1], "{options}");
    }
}

#[test]
fn a_seed_repeats_and_matters_to_random_choices() {
    let table = |seed: u64| {
        let out = TempDir::new().unwrap();
        let options = format!("--frames 2 --observe sparse --method joint --estimator lmeds --seed {seed}");
        run(recording(), out.path(), &options);
        assert_eq!(summary(out.path())["seed"], seed);
        fs::read_to_string(out.path().join("motion.csv")).unwrap()
    };
    let (a, b, c) = (table(1), table(1), table(2));
    assert_eq!(a, b);
    assert_ne!(a, c);
}
