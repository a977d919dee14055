//! A run that was stopped, killed or ran out of space, and goes on: nothing tells it from one that was not.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::Command;

use assert_cmd::cargo::cargo_bin;
use serde_json::Value;

use crate::background::{Background, Blocked, frames_in, journal, whole_lines};
use crate::process::{Ended, assert_refused, egomotion, names, run, summary, try_run};
use crate::recording::{Copy, FRAMES, recording};
use crate::table::motion;

const JOURNAL: &str = "run.parts.jsonl";

/// What is between two marks, each time, and the marks, cut out.
fn without(mut text: &str, from: &str, to: &str) -> String {
    let mut rest = String::new();
    while let Some((before, after)) = text.split_once(from) {
        rest += before;
        text = after.split_once(to).unwrap_or_else(|| panic!("no {to} after {from}")).1;
    }
    rest + text
}

/// A file's content without the milliseconds that the run took.
fn timeless(path: &Path) -> Vec<u8> {
    let content = fs::read(path).unwrap();
    match path.file_name().and_then(|name| name.to_str()) {
        Some("summary.json") => {
            let mut summary: Value = serde_json::from_slice(&content).unwrap();
            for key in ["stages_ms", "frame_ms", "wall_s"] {
                summary.as_object_mut().unwrap().remove(key);
            }
            summary.to_string().into_bytes()
        }
        Some("report.html") => {
            let page = String::from_utf8(content).unwrap();
            let page = without(&page, "<table class=\"stages\">", "</table>");
            page.split("<p").filter(|part| !part.contains(" ms a frame</b>")).collect::<String>().into_bytes()
        }
        _ => content,
    }
}

/// The same files with the same content, folder by folder.
fn assert_same(found: &Path, expected: &Path) {
    assert_eq!(names(found), names(expected), "{}", found.display());
    for name in names(expected) {
        let (found, expected) = (found.join(&name), expected.join(&name));
        if expected.is_dir() {
            assert_same(&found, &expected);
        } else {
            assert!(timeless(&found) == timeless(&expected), "{} differs", found.display());
        }
    }
}

/// Results of the whole command, moved away from the folder that it names.
fn whole(copy: &Copy, options: &str) -> std::path::PathBuf {
    let place = copy.out().with_file_name("whole");
    run(&copy.source(), &copy.out(), options);
    fs::rename(copy.out(), &place).unwrap();
    place
}

/// A run that was killed in frame 3, with the frames before it in its journal.
fn killed(copy: &Copy, options: &str) {
    let blocked = Blocked::at(copy.file("image_0/000003.png"));
    let mut running = Background::run(&copy.source(), &copy.out(), options);
    running.wait_for_frames(&copy.out(), 3);
    running.kill();
    blocked.restore();
}

/// The text of a run's journal.
fn journal_text(out: &Path) -> String {
    fs::read_to_string(journal(out)).unwrap()
}

#[test]
fn a_killed_run_goes_on_to_the_same_files() {
    let copy = Copy::new();
    // One frame gives no answer, so that it is in the journal too.
    fs::write(copy.file("image_1/000001.png"), "no picture").unwrap();
    let options = "--maps --maps-as colour --quiet";
    let whole = whole(&copy, options);
    killed(&copy, options);
    let out = copy.out();
    assert!(!out.join("motion.csv").exists(), "a killed run has written no results");
    // What a kill in the middle of a write leaves.
    let half = format!("{}{{\"part\":\"00", journal_text(&out));
    fs::write(out.join(JOURNAL), half).unwrap();
    for place in [&out, &out.join("impact")] {
        fs::write(place.join(".egomotion-Xy12Z3"), "half").unwrap();
    }
    let kept = fs::metadata(out.join("disparity/000000.pfm")).unwrap().modified().unwrap();
    let ended = run(&copy.source(), &out, &format!("{options} --resume"));
    assert!(!ended.stderr.contains("frame 1:"), "frame 1 is done already: {}", ended.stderr);
    assert_eq!(fs::metadata(out.join("disparity/000000.pfm")).unwrap().modified().unwrap(), kept);
    assert_same(&out, &whole);
    assert_eq!(motion(&out)[0].status(), "bad_image");
}

#[test]
fn an_interrupted_run_goes_on_and_may_be_interrupted_again() {
    let copy = Copy::new();
    let options = "--quiet --maps --method ml";
    let whole = whole(&copy, options);
    let out = copy.out();
    for (frame, resume) in [(2, ""), (4, "--resume --threads 1")] {
        let blocked = Blocked::at(copy.file(&format!("image_1/{frame:06}.png")));
        let mut running = Background::run(&copy.source(), &out, &format!("{options} {resume}"));
        running.wait_for_file(&out.join(format!("impact_hi/{:06}.pfm", frame - 2)));
        running.interrupt();
        running.wait_for_message("stopping after this frame");
        // The frame that is read when the signal comes is read to its end.
        blocked.write();
        let ended = running.ended();
        assert_eq!(ended.code, 130, "{}", ended.stderr);
        assert!(ended.stderr.contains("the same command with --resume goes on"), "{}", ended.stderr);
        let summary = summary(&out);
        assert_eq!(summary["complete"], false);
        assert!(summary["frames"].as_u64().unwrap() <= frame, "{}", summary["frames"]);
        assert_eq!(motion(&out).len() as u64, summary["frames"].as_u64().unwrap() - 1);
        assert!(fs::read_to_string(out.join("report.html")).unwrap().contains("stopped before its end"));
        blocked.restore();
    }
    run(&copy.source(), &out, &format!("{options} --resume"));
    assert_same(&out, &whole);
}

#[test]
fn a_second_ctrl_c_stops_at_once_and_what_is_done_is_kept() {
    let copy = Copy::new();
    let blocked = Blocked::at(copy.file("image_0/000003.png"));
    let mut running = Background::run(&copy.source(), &copy.out(), "--quiet --observe sparse");
    running.wait_for_frames(&copy.out(), 3);
    running.interrupt();
    running.wait_for_message("a second Ctrl-C stops at once");
    running.interrupt();
    let ended = running.ended();
    assert_eq!(ended.code, 130, "{}", ended.stderr);
    assert_eq!(frames_in(&whole_lines(&journal(&copy.out()))), 3);
    blocked.restore();
    run(&copy.source(), &copy.out(), "--quiet --observe sparse --resume");
    assert_eq!(motion(&copy.out()).len(), FRAMES - 1);
}

/// The command in a shell that lets no file grow beyond so many blocks of 512 bytes: like a full disk.
fn with_little_space(source: &Path, out: &Path, options: &str, blocks: usize) -> Ended {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &script, "sh"]).arg(cargo_bin!("egomotion"));
    command.arg("run").arg(source).arg("--out").arg(out).args(options.split_whitespace());
    Ended::of(command.output().unwrap())
}

#[test]
fn a_run_without_space_goes_on_when_there_is_some() {
    let copy = Copy::new();
    let options = "--quiet --observe sparse";
    let whole = whole(&copy, options);
    // Space for the head and the first part, which holds the first frame alone, and not for four frames more.
    killed(&copy, options);
    let first = whole_lines(&journal(&copy.out())).iter().take(2).map(String::len).sum::<usize>();
    let blocks = first / 512 + 2;
    fs::remove_dir_all(copy.out()).unwrap();
    for resume in ["", "--resume"] {
        let ended = with_little_space(&copy.source(), &copy.out(), &format!("{options} {resume}"), blocks);
        assert_refused(&ended, 1, &[JOURNAL, "cannot write"]);
        assert!(!copy.out().join("summary.json").exists());
    }
    run(&copy.source(), &copy.out(), &format!("{options} --resume"));
    assert_same(&copy.out(), &whole);
}

#[test]
fn tracks_go_on_too() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tracks.csv");
    let mut text = String::from("frame,track,u_left,v_left,u_right,v_right\n");
    for (frame, track) in (0..5_u32).flat_map(|frame| (0..60_u32).map(move |track| (frame, track))) {
        let grow = 1.01_f64.powi(frame as i32);
        let (x, y) = (f64::from(track % 10) * 20.0 - 90.0, f64::from(track / 10) * 20.0 - 50.0);
        let d = (8.0 + f64::from(track % 5)) * grow;
        let (u, v) = (160.0 + x * grow, 120.0 + y * grow);
        text += &format!("{frame},{track},{u},{v},{},{v}\n", u - d);
    }
    fs::write(&file, text).unwrap();
    let options = format!("--quiet --tracks {}", file.display());
    let (whole, out) = (folder.path().join("whole"), folder.path().join("out"));
    run(recording(), &out, &options);
    fs::rename(&out, &whole).unwrap();
    // Space for some frames and not for all.
    assert_refused(&with_little_space(recording(), &out, &options, 40), 1, &[JOURNAL, "cannot write"]);
    let frames = frames_in(&whole_lines(&journal(&out)));
    assert!((1..5).contains(&frames), "some frames, not all: {frames}");
    run(recording(), &out, &format!("{options} --resume"));
    assert_same(&out, &whole);
}

#[test]
fn another_run_is_refused_and_told_what_differs() {
    let copy = Copy::new();
    killed(&copy, "--quiet --observe sparse");
    let (source, out) = (copy.source(), copy.out());
    let before = journal_text(&out);
    let refused = |source: &Path, options: &str, parts: &[&str]| {
        assert_refused(&try_run(source, &out, &format!("--quiet --resume {options}")), 1, parts);
        assert_eq!(journal_text(&out), before, "{options}: it is left as it was");
    };
    let same = "--observe sparse";
    refused(&source, "", &["other settings", "config.observe was sparse and is dense", "without --resume"]);
    refused(&source, &format!("{same} --method dv"), &["config.method was ml and is dv"]);
    refused(
        &source,
        &format!("{same} --stride 2"),
        &["options.stride was 1 and is 2", "frames was 5 and is 3"],
    );
    refused(&source, &format!("{same} --reverse"), &["options.reverse was false and is true"]);
    refused(recording(), same, &["options.source was "]);
    let mask = copy.out().with_file_name("mask.png");
    fs::copy(copy.file("image_0/000000.png"), &mask).unwrap();
    refused(
        &source,
        &format!("{same} --mask {}", mask.display()),
        &["options.mask was none and is ", "mask.png"],
    );
    // What differs in nothing that matters is the same run; so is the same file by another name.
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    fs::write(out.join(JOURNAL), before.replace(&version, "\"version\":\"0.0.1\"")).unwrap();
    let ended = try_run(&source, &out, &format!("--quiet --resume {same}"));
    assert_refused(&ended, 1, &[JOURNAL, "run of egomotion 0.0.1, this is run of "]);
    fs::write(out.join(JOURNAL), "my diary\n").unwrap();
    let ended = try_run(&source, &out, &format!("--quiet --resume {same}"));
    assert_refused(&ended, 1, &[JOURNAL, ":1: does not tell what was begun"]);
    fs::write(out.join(JOURNAL), &before).unwrap();
    let by_another_name = source.join("..").join("drive");
    run(&by_another_name, &out, &format!("--resume {same} --threads 2 --json"));
}

#[test]
fn a_recording_that_was_changed_is_refused() {
    let copy = Copy::new();
    killed(&copy, "--quiet --observe sparse");
    let before = journal_text(&copy.out());
    let change = |name: &str, change: &dyn Fn(String) -> Vec<u8>, parts: &[&str]| {
        let old = fs::read(copy.file(name)).unwrap();
        fs::write(copy.file(name), change(String::from_utf8_lossy(&old).into_owned())).unwrap();
        let ended = try_run(&copy.source(), &copy.out(), "--quiet --observe sparse --resume");
        assert_refused(&ended, 1, parts);
        assert_eq!(journal_text(&copy.out()), before);
        fs::write(copy.file(name), old).unwrap();
    };
    let image = fs::read(copy.file("image_0/000004.png")).unwrap();
    change(
        "image_0/000001.png",
        &|_| image.clone(),
        &["000001.png: frame 1 was changed since: its files had "],
    );
    change(
        "calib.txt",
        &|text| text.replace("250.0", "251.0").into_bytes(),
        &["rig.focal_px was 250.0 and is 251.0"],
    );
    let later = |text: String| text.replacen("100.1", "100.15", 1).into_bytes();
    change("times.txt", &later, &["frame 1 was changed since: its time was 100.1"]);
    // A frame that is still to come may be mended.
    fs::write(copy.file("image_0/000004.png"), "no picture").unwrap();
    run(&copy.source(), &copy.out(), "--quiet --observe sparse --resume");
    assert_eq!(motion(&copy.out())[3].status(), "bad_image");
}

#[test]
fn where_there_is_nothing_to_go_on_with() {
    let copy = Copy::new();
    let options = "--quiet --observe sparse";
    let resumed = || try_run(&copy.source(), &copy.out(), &format!("{options} --resume"));
    assert_refused(&resumed(), 1, &["holds no run to go on with", "run without --resume"]);
    assert!(!copy.out().exists(), "a refusal makes no folder");
    let ended = egomotion(["run", "-", "--resume", "--calibration", "rig.toml"]);
    assert_refused(&ended, 2, &["standard input"]);
    // Complete: it says so, and touches nothing.
    let first = run(&copy.source(), &copy.out(), &format!("{options} --json"));
    assert!(!names(&copy.out()).contains(&JOURNAL.to_owned()));
    let report = fs::metadata(copy.out().join("report.html")).unwrap().modified().unwrap();
    let again = resumed();
    assert_eq!((again.code, again.stderr.as_str()), (0, ""));
    assert!(again.stdout.contains("the run is complete, nothing is left to do"), "{}", again.stdout);
    let json = run(&copy.source(), &copy.out(), &format!("{options} --json --resume"));
    assert_eq!(json.json(), first.json());
    assert_eq!(fs::metadata(copy.out().join("report.html")).unwrap().modified().unwrap(), report);
    let other = try_run(&copy.source(), &copy.out(), "--quiet --observe sparse --stride 2 --resume");
    assert_refused(
        &other,
        1,
        &["summary.json: was begun with other settings", "options.stride was 1 and is 2"],
    );
    // A stopped run whose journal somebody removed.
    let text = fs::read_to_string(copy.out().join("summary.json")).unwrap();
    fs::write(copy.out().join("summary.json"), text.replace("\"complete\": true", "\"complete\": false"))
        .unwrap();
    assert_refused(&resumed(), 1, &["summary.json: that run was stopped, and its run.parts.jsonl is gone"]);
    // Anew it runs whatever is there.
    run(&copy.source(), &copy.out(), "--quiet --observe sparse --stride 2");
}

/// A set of three scenes of two frames each, in the layout of KITTI 2012.
fn scenes(folder: &Path) {
    fs::create_dir_all(folder.join("calib")).unwrap();
    for camera in ["image_0", "image_1"] {
        fs::create_dir(folder.join(camera)).unwrap();
    }
    for scene in 0..3 {
        fs::copy(recording().join("calib.txt"), folder.join(format!("calib/{scene:06}.txt"))).unwrap();
        for (camera, frame) in ["image_0", "image_1"].iter().flat_map(|c| [(c, 0), (c, 1)]) {
            let from = recording().join(format!("{camera}/{:06}.png", scene + frame));
            fs::copy(from, folder.join(format!("{camera}/{scene:06}_{}.png", 10 + frame))).unwrap();
        }
    }
}

#[test]
fn scenes_that_are_done_are_not_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let [source, out, whole] = ["training", "out", "whole"].map(|name| folder.path().join(name));
    scenes(&source);
    run(&source, &out, "--quiet");
    fs::rename(&out, &whole).unwrap();
    let blocked = Blocked::at(source.join("image_1/000002_11.png"));
    let mut running = Background::run(&source, &out, "--quiet");
    running.wait_for_parts(&journal(&out), 2);
    running.kill();
    blocked.restore();
    let done = || fs::metadata(out.join("000000/report.html")).unwrap().modified().unwrap();
    let before = done();
    assert_refused(&try_run(&source, &out, "--resume --observe sparse"), 1, &["config.observe was dense"]);
    let ended = run(&source, &out, "--quiet --resume");
    assert!(ended.stdout.contains("000002: ") && !ended.stdout.contains("000000: "), "{}", ended.stdout);
    assert_eq!(done(), before);
    assert_same(&out, &whole);
    let again = run(&source, &out, "--resume");
    assert!(again.stdout.contains("the run is complete"), "{}", again.stdout);
}

#[test]
fn pairs_of_one_time_that_are_done_are_not_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let [source, out, whole] = ["pairs", "out", "whole"].map(|name| folder.path().join(name));
    for name in ["one", "two"] {
        fs::create_dir_all(source.join(name)).unwrap();
        for (image, camera) in [("im2.png", "image_0"), ("im6.png", "image_1")] {
            fs::copy(recording().join(camera).join("000000.png"), source.join(name).join(image)).unwrap();
        }
    }
    run(&source, &out, "--quiet");
    fs::rename(&out, &whole).unwrap();
    let blocked = Blocked::at(source.join("two/im6.png"));
    let mut running = Background::run(&source, &out, "--quiet");
    running.wait_for_file(&out.join("one/summary.json"));
    running.wait_for_parts(&journal(&out), 1);
    running.kill();
    blocked.restore();
    let ended = run(&source, &out, "--quiet --resume");
    assert!(ended.stdout.contains("two: ") && !ended.stdout.contains("one: "), "{}", ended.stdout);
    let found = (summary(&out), summary(&whole));
    let names = |summary: &Value| summary["scenes"].as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found.0), names(&found.1));
    assert_eq!(found.0["scenes"]["one"]["counts"], found.1["scenes"]["one"]["counts"]);
    assert!(run(&source, &out, "--resume").stdout.contains("the run is complete"));
}
