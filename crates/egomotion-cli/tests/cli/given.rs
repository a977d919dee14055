//! Depth cameras, given maps and given tracks: the options, and what is said when something is missing.

use std::fs;

use tempfile::TempDir;

use crate::process::{assert_refused, egomotion, run, summary, try_run};
use crate::recording::recording;

#[test]
fn given_maps_are_used_and_a_missing_one_is_its_frames_status() {
    let source = recording();
    let (first, second) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    run(source, first.path(), "--frames 4 --maps --quiet");
    let maps = first.path().join("disparity");
    assert!(maps.join("000000.pfm").is_file());
    // The last frame has no map: only earlier frames of a pair do.
    let options = format!("--frames 4 --quiet --disparity {}", maps.display());
    run(source, second.path(), &options);
    let counts = &summary(second.path())["counts"];
    assert_eq!((counts["ok"].as_u64(), counts["missing_disparity"].as_u64()), (Some(2), Some(1)));
    let options = format!("--frames 3 --quiet --flow {}", first.path().join("flow").display());
    run(source, second.path(), &options);
    assert_eq!(summary(second.path())["counts"]["ok"], 2);
}

#[test]
fn tracks_as_csv_take_the_place_of_images() {
    let source = recording();
    let out = TempDir::new().unwrap();
    let file = out.path().join("tracks.csv");
    let mut text = String::from("frame,track,u_left,v_left,u_right,v_right\n");
    for frame in 0..3_u32 {
        for track in 0..40_u32 {
            // Points that come nearer by 1 % a frame.
            let grow = 1.01_f64.powi(frame as i32);
            let (x, y) = (f64::from(track % 8) * 20.0 - 70.0, f64::from(track / 8) * 20.0 - 40.0);
            let d = (8.0 + f64::from(track % 5)) * grow;
            let (u, v) = (160.0 + x * grow, 120.0 + y * grow);
            text += &format!("{frame},{track},{u},{v},{},{v}\n", u - d);
        }
    }
    fs::write(&file, text).unwrap();
    run(source, out.path(), &format!("--frames 3 --quiet --tracks {}", file.display()));
    assert_eq!(
        summary(out.path())["counts"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum::<u64>(),
        2
    );
    fs::write(&file, "frame,track\n").unwrap();
    let ended = try_run(source, out.path(), &format!("--quiet --tracks {}", file.display()));
    assert_refused(&ended, 1, &["tracks.csv:1", "u_left"]);
    let ended = try_run(source, out.path(), &format!("--quiet --maps --tracks {}", file.display()));
    assert_ne!(ended.code, 0);
}

#[test]
fn a_sensor_that_is_not_there_is_refused() {
    let out = TempDir::new().unwrap();
    let ended = try_run(recording(), out.path(), "--sensor depth --quiet");
    assert_refused(&ended, 2, &["has no depth images"]);
    let ended = egomotion(["run", "nowhere.npz"]);
    assert_refused(&ended, 1, &["nowhere.npz"]);
}
