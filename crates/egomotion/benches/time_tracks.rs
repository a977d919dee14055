//! Times four-way tracks over a KITTI sequence: `time_tracks FOLDER FRAMES CORNERS`, one line of figures.
//!
//! `bench/tracks.py` runs it beside OpenCV's corners and Lucas–Kanade on the same pairs. The times
//! are those of the pipeline, with the motion that guides the tracks, from the third frame on.

use std::path::Path;

use egomotion::geometry::StereoRig;
use egomotion::observe::TrackOptions;
use egomotion::pipeline::{Config, Observe, StereoFrame, StereoMotion};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, folder, frames, corners] = &arguments[..] else {
        println!("usage: time_tracks FOLDER FRAMES CORNERS");
        return;
    };
    let (frames, corners): (usize, usize) = (frames.parse().unwrap(), corners.parse().unwrap());
    let read = |side: usize, k: usize| {
        let path = Path::new(folder).join(format!("image_{side}/{k:06}.png"));
        egomotion_io::image::read(&path).unwrap()
    };
    let rig = StereoRig::new(707.0912, (601.8873, 183.1104), 0.5372, read(0, 0).size()).unwrap();
    let tracks = TrackOptions { corners, ..TrackOptions::default() };
    let config = Config { observe: Observe::Sparse, tracks, ..Config::default() };
    let mut pipeline = StereoMotion::new(rig, config).unwrap();
    let (mut pyramids, mut following, mut count) = (Vec::new(), Vec::new(), 0);
    for k in 0..frames {
        let frame = StereoFrame { time_s: 0.1 * k as f64, left: read(0, k), right: read(1, k) };
        let answer = pipeline.push(frame);
        if k >= 2 {
            pyramids.push(answer.stages.pyramids_ms);
            following.push(answer.stages.tracks_ms);
            count += answer.motion.map_or(0, |motion| motion.rows);
        }
    }
    let least_and_median = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        format!("{} {}", times[0], times[times.len() / 2])
    };
    println!(
        "{} {} {}",
        count / (frames - 2),
        least_and_median(&mut pyramids),
        least_and_median(&mut following)
    );
}
