//! A run that is stopped: what is done is written, and says so.
#![cfg(unix)]

use crate::background::{Background, Blocked};
use crate::outputs::trajectory;
use crate::process::{names, summary};
use crate::recording::{Copy, FRAMES};
use crate::table::motion;

#[test]
fn an_interrupted_run_writes_what_is_done() {
    let copy = Copy::new();
    // The last frame is being read while the user stops the run.
    let last = FRAMES - 1;
    let blocked = Blocked::at(copy.file(&format!("image_0/{last:06}.png")));
    let out = copy.out();
    let mut running = Background::run(&copy.source(), &out, "--maps");
    running.wait_for_file(&out.join(format!("impact_hi/{:06}.pfm", last - 2)));
    running.interrupt();
    running.wait_for_message("stopping after this frame; a second Ctrl-C stops at once");
    blocked.write();
    let ended = running.ended();
    assert_eq!(ended.code, 130, "{}", ended.stderr);
    assert!(ended.stderr.contains("the same command with --resume goes on"), "{}", ended.stderr);
    let rows = motion(&out);
    assert_eq!(rows.len(), last - 1);
    assert_eq!(trajectory(&out).len(), rows.len() + 1);
    let summary = summary(&out);
    assert_eq!((&summary["complete"], &summary["frames"]), (&false.into(), &(rows.len() + 1).into()));
    assert_eq!(names(&out.join("flow")).len(), rows.len());
    assert!(names(&out).iter().all(|name| !name.starts_with('.')));
}
