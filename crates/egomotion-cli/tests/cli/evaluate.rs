//! `egomotion evaluate` against an independent program.
//!
//! `data/truth_*.txt` is a curved drive of 41 poses, about 1.2 m and up to 1.7° a step, `data/estimate_*.txt`
//! the same with steps disturbed by 20 mm and 0.1° (normal, seeded); both made with numpy and scipy and written
//! with 10 digits. The expected values are the output of the project's independent script `evaluate.py`
//! (numpy 2.4, scipy 1.17), called as `python3 evaluate.py estimate_kitti.txt truth_kitti.txt 5,10,20,40`.

use std::fs;

use serde_json::Value;

use tempfile::TempDir;

use crate::process::{Ended, assert_refused, egomotion};

/// A file of `data/`.
fn data(name: &str) -> String {
    format!("{}/tests/cli/data/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// `evaluate --json`, with options separated by blanks.
fn evaluate(estimate: &str, truth: &str, options: &str) -> Ended {
    let files = ["evaluate".to_owned(), estimate.to_owned(), truth.to_owned(), "--json".to_owned()];
    let ended = egomotion(files.into_iter().chain(options.split_whitespace().map(String::from)));
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    ended
}

/// Keys and values of the report; `None` is null.
fn assert_report(ended: &Ended, expected: &[(&str, Option<f64>)]) {
    let report = ended.json();
    for (key, value) in expected {
        let found = report.get(*key).unwrap_or_else(|| panic!("{key} is missing from {report}"));
        match value {
            None => assert!(found.is_null(), "{key}: {found}"),
            // Angles come through an arc cosine near 0, which loses half of the digits.
            Some(value) => {
                assert!((found.as_f64().unwrap() - value).abs() < 1e-7, "{key}: {found}, not {value}")
            }
        }
    }
}

const STEPS: [(&str, Option<f64>); 6] = [
    ("frames", Some(41.0)),
    ("t_rmse_m", Some(0.035182790458004445)),
    ("t_median_m", Some(0.027378650427248654)),
    ("t_max_m", Some(0.06594416199989017)),
    ("r_rmse_deg", Some(0.20125913485594485)),
    ("r_median_deg", Some(0.1827837936672658)),
];

#[test]
fn kitti_rows() {
    let (estimate, truth) = (data("estimate_kitti.txt"), data("truth_kitti.txt"));
    for format in ["", "--format kitti"] {
        let ended = evaluate(&estimate, &truth, &format!("--lengths 5,10,20,40 {format}"));
        assert_eq!(ended.stderr, "");
        assert_report(&ended, &STEPS);
        assert_report(
            &ended,
            &[
                ("segments", Some(12.0)),
                ("drift_percent", Some(1.0797913692563925)),
                ("drift_deg_per_m", Some(0.06620493828270939)),
            ],
        );
    }
    assert_report(
        &evaluate(&estimate, &truth, "--lengths 7.5"),
        &[
            ("segments", Some(4.0)),
            ("drift_percent", Some(1.131074147930519)),
            ("drift_deg_per_m", Some(0.06970492171730082)),
        ],
    );
}

#[test]
fn tum_rows() {
    let (estimate, truth) = (data("estimate_tum.txt"), data("truth_tum.txt"));
    for format in ["", "--format tum"] {
        let ended = evaluate(&estimate, &truth, &format!("--lengths 5,10,20,40 {format}"));
        assert_report(
            &ended,
            &[
                ("frames", Some(41.0)),
                ("t_rmse_m", Some(0.03518279047396146)),
                ("r_rmse_deg", Some(0.20125916383250497)),
                ("segments", Some(12.0)),
                ("drift_percent", Some(1.0797913639503278)),
                ("drift_deg_per_m", Some(0.06620494229550263)),
            ],
        );
    }
}

#[test]
fn a_path_that_is_too_short_has_no_drift() {
    // 47 m: shorter than the benchmark's shortest length.
    let ended = evaluate(&data("estimate_kitti.txt"), &data("truth_kitti.txt"), "");
    assert_report(&ended, &STEPS);
    assert_report(&ended, &[("segments", Some(0.0)), ("drift_percent", None), ("drift_deg_per_m", None)]);
}

#[test]
fn the_common_part_is_compared_and_that_is_said() {
    let folder = TempDir::new().unwrap();
    let short = folder.path().join("short.txt");
    let text = fs::read_to_string(data("estimate_kitti.txt")).unwrap();
    fs::write(&short, text.lines().take(25).map(|line| format!("{line}\n")).collect::<String>()).unwrap();
    // One file in each format.
    let ended = evaluate(short.to_str().unwrap(), &data("truth_tum.txt"), "--lengths 5,10");
    assert!(ended.stderr.contains("25 poses") && ended.stderr.contains("41"), "{}", ended.stderr);
    assert_report(
        &ended,
        &[
            ("frames", Some(25.0)),
            ("t_rmse_m", Some(0.03810707789249825)),
            ("r_rmse_deg", Some(0.20841526170116215)),
            ("segments", Some(5.0)),
            ("drift_percent", Some(1.3370829684334162)),
            ("drift_deg_per_m", Some(0.08615096284553861)),
        ],
    );
}

#[test]
fn words_say_the_same_as_json() {
    let ended = egomotion([
        "evaluate",
        &data("estimate_kitti.txt"),
        &data("truth_kitti.txt"),
        "--lengths",
        "5,10,20,40",
    ]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    for part in ["41 poses", "35.183 mm", "0.20126°", "1.080 %", "0.06620 °/m", "12 segments"] {
        assert!(ended.stdout.contains(part), "{part:?} is not in\n{}", ended.stdout);
    }
}

#[test]
fn files_that_are_no_trajectories() {
    let folder = TempDir::new().unwrap();
    let bad = folder.path().join("bad.txt");
    let truth = data("truth_kitti.txt");
    let refused = |text: &str, options: &[&str], parts: &[&str]| {
        fs::write(&bad, text).unwrap();
        let args = ["evaluate", bad.to_str().unwrap(), &truth];
        assert_refused(&egomotion(args.iter().chain(options)), 1, parts);
    };
    let row = "1 0 0 0 0 1 0 0 0 0 1 0\n";
    refused("", &[], &["bad.txt: holds no pose"]);
    refused("1 2 3\n", &[], &["bad.txt:1: the row has 3 numbers, not 8 or 12"]);
    refused(&format!("{row}{}", row.replacen('1', "nan", 1)), &[], &["bad.txt:2", "not a finite number"]);
    refused(&row.replacen('1', "3", 1), &[], &["bad.txt:1: the matrix is not a rotation"]);
    refused(row, &["--format", "tum"], &["bad.txt:1: the row has 12 numbers, not 8"]);
    refused(row, &[], &["bad.txt: 1 pose in common", "two are needed"]);
    let missing = egomotion(["evaluate", "missing.txt", &truth]);
    assert_refused(&missing, 1, &["missing.txt: cannot read", "check the path"]);
}

/// `data/evo`: trajectories of 60 and 57 poses with clocks of their own, in worlds of their own, at another scale, and
/// what evo 1.38 says of them; all made by `bench/evaluate.py`.
#[test]
fn figures_are_those_of_evo() {
    let text = fs::read_to_string(data("evo/expected.json")).unwrap();
    let expected: Value = serde_json::from_str(&text).unwrap();
    let (estimate, truth) = (data("evo/estimate.txt"), data("evo/truth.txt"));
    for name in ["none", "se3", "sim3"] {
        let report = evaluate(&estimate, &truth, &format!("--align {name} --delta 1f,3f,5m")).json();
        assert_eq!(report["frames"], expected["poses"]);
        assert_eq!(report["alignment"], name);
        let same = |found: &Value, expected: &Value, what: &str| {
            for (key, value) in expected.as_object().unwrap() {
                let (found, value) = (found[key].as_f64().unwrap(), value.as_f64().unwrap());
                // Sums of squares of metres are large.
                assert!(
                    (found - value).abs() <= 1e-6 * value.abs().max(1.0),
                    "{name} {what} {key}: {found}, not {value}"
                );
            }
        };
        same(&report["absolute_m"], &expected[name]["absolute_m"], "absolute");
        for (over, delta) in report["relative"].as_array().unwrap().iter().zip(["1f", "3f", "5m"]) {
            assert_eq!(over["delta"], delta);
            for part in ["translation_m", "rotation_deg"] {
                same(&over[part], &expected[name][delta][part], &format!("{delta} {part}"));
            }
        }
    }
}

#[test]
fn clocks_that_never_meet_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("late.txt");
    let late: String = fs::read_to_string(data("evo/estimate.txt"))
        .unwrap()
        .lines()
        .map(|line| format!("9{line}\n"))
        .collect();
    fs::write(&path, late).unwrap();
    let files = ["evaluate".to_owned(), path.display().to_string(), data("evo/truth.txt")];
    let ended = egomotion(files.clone());
    assert_refused(&ended, 1, &["late.txt: 0 pose lies within 0.01 s of one of", "--associate row"]);
    let ended = egomotion(files.into_iter().chain(["--associate".to_owned(), "row".to_owned()]));
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(ended.stdout.starts_with("57 poses, associated by row\n"), "{}", ended.stdout);
}

#[test]
fn distances_and_alignments_that_mean_nothing_are_wrong_usage() {
    let (estimate, truth) = (data("evo/estimate.txt"), data("evo/truth.txt"));
    for option in ["--delta=1x", "--delta=0m", "--delta=-1s", "--delta=0f", "--align=affine"] {
        let files = ["evaluate", &estimate, &truth, option].map(String::from);
        assert_eq!(egomotion(files).code, 2, "{option}");
    }
}
