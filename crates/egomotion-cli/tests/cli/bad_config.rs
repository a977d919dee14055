//! Options and settings that are wrong: exit code 2 for the command line, 1 for a file.

use std::fs;

use tempfile::TempDir;

use crate::process::{assert_refused, egomotion, try_run};
use crate::recording::recording;

#[test]
fn what_cannot_be_typed_is_wrong_usage() {
    for args in [
        &["--frobnicate"][..],
        &["run"],
        &["run", "x", "--method", "magic"],
        &["run", "x", "--approach", "sideways"],
        &["run", "x", "--estimator", "guess"],
        &["run", "x", "--observe", "nothing"],
        &["run", "x", "--nonsense"],
        &["run", "x", "--frames", "many"],
        &["run", "x", "--frames", "-3"],
        &["run", "x", "--stride", "0"],
        &["run", "x", "--threads", "0"],
        &["run", "x", "--seed", "1.5"],
        &["demo", "--nonsense"],
        &["demo", "--threads", "0"],
        &["evaluate", "x"],
        &["evaluate", "x", "y", "--lengths", "a"],
        &["info"],
        &["fly"],
        &[],
    ] {
        let ended = egomotion(args);
        assert_eq!(ended.code, 2, "{args:?}: {}", ended.stderr);
        assert!(ended.stdout.is_empty() && !ended.stderr.is_empty(), "{args:?}");
    }
}

#[test]
fn help_and_version_are_no_errors() {
    for args in [&["--help"][..], &["run", "--help"], &["--version"], &["demo", "--help"]] {
        let ended = egomotion(args);
        assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{args:?}");
        assert!(!ended.stdout.is_empty());
    }
    assert!(egomotion(["--version"]).stdout.contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn combinations_without_meaning_are_refused_with_the_reason() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    for (options, reason) in [
        ("--method ml --estimator ls", "use estimator irls"),
        ("--method joint --estimator eiv", "use method dcce"),
        ("--estimator eiv", "use method dcce"),
        ("--estimator lmeds", "use estimator irls"),
        ("--method rigid --approach differential", "use approach discrete"),
        ("--method linear22 --approach differential", "use approach discrete"),
        ("--method dcce --observe sparse", "use observe dense"),
        ("--maps --observe sparse", "use observe dense"),
    ] {
        assert_refused(&try_run(recording(), &out, options), 2, &[reason]);
    }
    for (options, reason) in [
        ("--raw 320x240", "--raw tells how frames on standard input are coded"),
        ("--side-by-side", "it needs SOURCE -"),
    ] {
        assert_refused(&try_run(recording(), &out, options), 2, &[reason]);
    }
    for option in [&["--mask", "m.png"][..], &["--start", "1"], &["--reverse"], &["--tracks", "t.csv"]] {
        let ended = egomotion([&["run", "-", "--calibration", "rig.toml"], option].concat());
        assert_refused(&ended, 2, &["frames on standard input are taken as they come", option[0]]);
    }
    // Also when the file says one half of it.
    let file = folder.path().join("settings.toml");
    fs::write(&file, "estimator = \"ls\"\n").unwrap();
    assert_refused(&try_run(recording(), &out, &format!("--config {}", file.display())), 2, &["irls"]);
    assert!(!out.exists());
}

#[test]
fn a_file_of_settings_is_named_with_its_line() {
    let folder = TempDir::new().unwrap();
    let (file, out) = (folder.path().join("settings.toml"), folder.path().join("out"));
    let with_file = |text: &[u8]| {
        fs::write(&file, text).unwrap();
        try_run(recording(), &out, &format!("--observe sparse --config {}", file.display()))
    };
    for (text, line, part) in [
        ("method = \"ml\"\nspeed = 3\n", 2, "unknown field `speed`"),
        ("seed = 1\n\n[tracks]\n# note\ncornerz = 3\n", 5, "unknown field `cornerz`"),
        ("seed = 1\nmethod = \"magic\"\n", 2, "unknown variant `magic`"),
        ("seed = 1\n\nmethod = \"ml\n", 3, ""),
        ("seed = \"many\"\n", 1, "invalid type"),
        ("seed = -1\n", 1, "invalid value"),
        ("= 3\n", 1, ""),
        ("method\n", 1, ""),
        ("seed = 1\nseed = 2\n", 2, "duplicate key"),
        ("\u{fc} = 3\n", 1, ""),
    ] {
        assert_refused(&with_file(text.as_bytes()), 1, &[&format!("settings.toml:{line}: "), part]);
    }
    assert_refused(&with_file(&[0xff, 0xfe]), 1, &["settings.toml"]);
    fs::remove_file(&file).unwrap();
    let ended = try_run(recording(), &out, &format!("--config {}", file.display()));
    assert_refused(&ended, 1, &["settings.toml", "cannot read"]);
    assert!(!out.exists());
}

#[test]
fn a_key_of_an_earlier_version_is_refused_with_the_new_name() {
    let folder = TempDir::new().unwrap();
    let (file, out) = (folder.path().join("settings.toml"), folder.path().join("out"));
    for (text, line) in [
        ("seed = 1\n\n[window]\nwidth_m = 2.0\n", 3),
        ("window.width_m = 2.0\n", 1),
        // It comes before an error that follows from it.
        ("[window]\nno_such_key = 2.0\n", 1),
    ] {
        fs::write(&file, text).unwrap();
        let ended = try_run(recording(), &out, &format!("--config {}", file.display()));
        let told = format!("settings.toml:{line}: there is no key window any more");
        assert_refused(&ended, 1, &[&told, "write vehicle instead"]);
    }
    assert!(!out.exists());
}

#[test]
fn settings_out_of_range_end_in_a_message() {
    let folder = TempDir::new().unwrap();
    let (file, out) = (folder.path().join("settings.toml"), folder.path().join("out"));
    for text in [
        "block_px = 0.0",
        "block_px = nan",
        "sample_step_px = 0",
        "tracks.corners = 0",
        "irls.nu = -1.0",
        "flow.window_radius_px = 0",
        "disparity.levels = 0",
        "lmeds.confidence = 1.0",
        "maximum_likelihood.confidence = 1.0",
        "maximum_likelihood.outliers = 0.99",
    ] {
        fs::write(&file, text).unwrap();
        let ended = try_run(recording(), &out, &format!("--config {}", file.display()));
        let name = text.split(' ').next().unwrap().rsplit('.').next().unwrap();
        assert_refused(&ended, 2, &[name, "must be"]);
    }
}

#[test]
fn a_length_that_is_none_is_wrong_usage() {
    for lengths in ["0", "nan", "5,inf"] {
        let ended = egomotion(["evaluate", "a.txt", "b.txt", "--lengths", lengths]);
        assert_refused(&ended, 2, &["is not a positive length"]);
    }
}
