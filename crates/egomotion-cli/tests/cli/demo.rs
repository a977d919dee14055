//! `egomotion demo`, judged against its exact truth.

use assert_cmd::cargo::cargo_bin_cmd;
use tempfile::TempDir;

use crate::outputs::trajectory;
use crate::process::{Ended, summary};
use crate::table::motion;

#[test]
fn the_demo_is_right_and_knows_how_right() {
    let place = TempDir::new().unwrap();
    let output = cargo_bin_cmd!("egomotion").current_dir(place.path()).arg("demo").output().unwrap();
    let ended = Ended::of(output);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let out = place.path().join("egomotion-out").join("demo");
    let summary = summary(&out);
    let frames = 24;
    assert_eq!((&summary["frames"], &summary["complete"]), (&frames.into(), &true.into()));
    assert_eq!((trajectory(&out).len(), motion(&out).len()), (frames, frames - 1));
    assert!(motion(&out).iter().all(|row| row.status() == "ok"));
    // A line for each pair, and the verdict.
    for part in ["motion  ", "VZ  ", "disparity  ", "impact  ", "results     egomotion-out/demo"] {
        assert!(ended.stdout.contains(part), "{part:?} is not in\n{}", ended.stdout);
    }
    let truth = &summary["truth"];
    assert_eq!(truth["components"], 6 * (frames - 1));
    let nees = truth["nees_per_component"].as_f64().unwrap();
    let within = truth["within_2_sigma"].as_f64().unwrap();
    assert!((0.6..=1.6).contains(&nees), "NEES/6 {nees}, {within} within 2σ");
    assert!((0.90..=0.99).contains(&within), "{within} within 2σ, NEES/6 {nees}");
    let printed = format!("NEES/6 {nees:.2}; {:.1} % of {} components", 100.0 * within, 6 * (frames - 1));
    assert!(ended.stdout.contains(&printed), "{printed:?} is not in\n{}", ended.stdout);
}
