//! Results that cannot be written, and readers that stop listening.

use std::fs;
use std::io::Read;
use std::process::{Command, Stdio};

use assert_cmd::cargo::cargo_bin;
use tempfile::TempDir;

use crate::process::{Ended, assert_refused, names, try_run};
use crate::recording::recording;

#[test]
fn a_file_in_the_place_of_the_folder() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "mine").unwrap();
    assert_refused(&try_run(recording(), &file, ""), 1, &["file: cannot make the folder"]);
    let below = file.join("deep").join("out");
    assert_refused(&try_run(recording(), &below, ""), 1, &["out: cannot make the folder"]);
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
    assert_eq!(names(folder.path()), ["file"]);
}

#[test]
fn a_file_in_the_place_of_a_folder_of_maps() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("impact"), "mine").unwrap();
    let ended = try_run(recording(), folder.path(), "--maps");
    assert_refused(&ended, 1, &["impact: cannot make the folder"]);
    assert_eq!(fs::read_to_string(folder.path().join("impact")).unwrap(), "mine");
}

#[test]
fn a_folder_in_the_place_of_a_file() {
    for name in ["motion.csv", "summary.json", "trajectory_tum.txt"] {
        let folder = TempDir::new().unwrap();
        fs::create_dir(folder.path().join(name)).unwrap();
        let ended = try_run(recording(), folder.path(), "--frames 2 --observe sparse");
        assert_eq!(ended.code, 1, "{name}: {}", ended.stderr);
        assert!(ended.stderr.contains(&format!("{name}: cannot write")), "{}", ended.stderr);
        assert!(folder.path().join(name).is_dir());
        assert!(names(folder.path()).iter().all(|name| !name.starts_with('.')), "{:?}", names(folder.path()));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_takes_nothing() {
    // No folder can be made in /proc, whoever asks.
    let out = std::path::Path::new("/proc/egomotion-out");
    assert_refused(&try_run(recording(), out, ""), 1, &["/proc/egomotion-out: cannot make the folder"]);
}

/// Run with one stream closed at its other end before anything is written.
fn with_closed(stream: &str, args: &[&str]) -> (i32, TempDir, String) {
    let folder = TempDir::new().unwrap();
    let mut command = Command::new(cargo_bin!("egomotion"));
    command.args(args).current_dir(folder.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    match stream {
        "stdout" => drop(child.stdout.take()),
        _ => drop(child.stderr.take()),
    }
    let ended = child.wait_with_output().unwrap();
    let ended = Ended::of(ended);
    (ended.code, folder, ended.stderr)
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let source = recording().to_str().unwrap();
    for args in [
        &["run", source, "--out", "out", "--frames", "2", "--observe", "sparse"][..],
        &["run", source, "--out", "out", "--frames", "2", "--observe", "sparse", "--json"],
    ] {
        let (code, folder, stderr) = with_closed("stdout", args);
        assert_eq!((code, stderr.as_str()), (0, ""), "{args:?}");
        // The results do not depend on somebody reading the words.
        assert!(
            folder.path().join("out/summary.json").exists() && folder.path().join("out/motion.csv").exists()
        );
    }
    let (code, _, stderr) = with_closed("stdout", &["info", source]);
    assert_eq!((code, stderr.as_str()), (0, ""));
    let poses = recording().join("poses.txt");
    let poses = poses.to_str().unwrap();
    let (code, _, stderr) = with_closed("stdout", &["evaluate", poses, poses, "--json"]);
    assert_eq!((code, stderr.as_str()), (0, ""));
}

#[test]
fn messages_that_nobody_hears_do_no_harm() {
    // A bad frame writes to standard error in the middle of the run.
    let copy = crate::recording::Copy::new();
    fs::write(copy.file("image_1/000002.png"), "no picture").unwrap();
    let source = copy.source();
    let args = ["run", source.to_str().unwrap(), "--out", "out", "--observe", "sparse"];
    let (code, folder, _) = with_closed("stderr", &args);
    assert_eq!(code, 0);
    assert_eq!(crate::table::motion(&folder.path().join("out")).len(), crate::recording::FRAMES - 1);
    let (code, ..) = with_closed("stderr", &["info", "missing"]);
    assert_eq!(code, 1);
}

#[test]
fn the_first_line_can_be_read_alone() {
    let mut child = Command::new(cargo_bin!("egomotion"))
        .args(["info", recording().to_str().unwrap()])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = [0; 1];
    child.stdout.take().unwrap().read_exact(&mut first).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
