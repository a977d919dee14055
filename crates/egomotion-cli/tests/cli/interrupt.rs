//! A run that is stopped: what is done is written, and says so.
#![cfg(unix)]

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;

use crate::outputs::trajectory;
use crate::process::{Ended, names, summary};
use crate::recording::{Copy, FRAMES};
use crate::table::motion;

#[test]
fn an_interrupted_run_writes_what_is_done() {
    let copy = Copy::new();
    // The drive forth and back a few hundred times: longer than any machine takes until the signal.
    fs::remove_file(copy.file("times.txt")).unwrap();
    fs::remove_file(copy.file("poses.txt")).unwrap();
    let frames = 400;
    for k in FRAMES..frames {
        let there = k % (2 * FRAMES - 2);
        let from = there.min(2 * FRAMES - 2 - there);
        for camera in ["image_0", "image_1"] {
            let [from, to] = [from, k].map(|k| copy.file(&format!("{camera}/{k:06}.png")));
            fs::hard_link(from, to).unwrap();
        }
    }
    let mut command = Command::new(cargo_bin!("egomotion"));
    command.arg("run").arg(copy.source()).arg("--out").arg(copy.out()).arg("--maps");
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let started = Instant::now();
    let third = copy.out().join("impact").join("000002.pfm");
    while !third.exists() {
        assert!(started.elapsed() < Duration::from_secs(60), "nothing is written");
        std::thread::sleep(Duration::from_millis(10));
    }
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let ended = Ended::of(child.wait_with_output().unwrap());
    assert_eq!(ended.code, 130, "{}", ended.stderr);
    let rows = motion(&copy.out());
    assert!(rows.len() >= 3 && rows.len() < frames - 1, "{}", rows.len());
    assert_eq!(trajectory(&copy.out()).len(), rows.len() + 1);
    let summary = summary(&copy.out());
    assert_eq!((&summary["complete"], &summary["frames"]), (&false.into(), &(rows.len() + 1).into()));
    assert_eq!(names(&copy.out().join("flow")).len(), rows.len());
    assert!(names(&copy.out()).iter().all(|name| !name.starts_with('.')));
}
