//! Times four-way tracks over a KITTI sequence: `time_tracks FOLDER FRAMES CORNERS`, one line of figures.
//!
//! `bench/tracks.py` runs it beside OpenCV's corners and Lucas–Kanade on the same pairs. Nothing is
//! kept from pair to pair but the later frame's pyramids, and nothing is known of the motion.

use std::path::Path;
use std::time::Instant;

use egomotion::geometry::{Image, StereoRig};
use egomotion::observe::StereoPyramid;
use egomotion::observe::tracks::{Hints, TrackOptions, stereo_tracks};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, folder, frames, corners] = &arguments[..] else {
        eprintln!("usage: time_tracks FOLDER FRAMES CORNERS");
        std::process::exit(2);
    };
    let (frames, corners): (usize, usize) = (frames.parse().unwrap(), corners.parse().unwrap());
    let read = |side: usize, k: usize| {
        let path = Path::new(folder).join(format!("image_{side}/{k:06}.png"));
        egomotion_io::image::read(&path).unwrap()
    };
    let pairs: Vec<(Image, Image)> = (0..frames).map(|k| (read(0, k), read(1, k))).collect();
    let (width, height) = pairs[0].0.size();
    let rig = StereoRig::new(707.0912, (601.8873, 183.1104), 0.5372, (width, height)).unwrap();
    let options = TrackOptions { corners, ..TrackOptions::default() };
    let levels = options.pyramid_levels;
    let mut pyramids = [0, 0].map(|k: usize| StereoPyramid::new(&pairs[k].0, &pairs[k].1, levels));
    let (mut build_ms, mut track_ms, mut count) = (Vec::new(), Vec::new(), 0);
    for pair in pairs.iter().skip(1) {
        let start = Instant::now();
        let [before, after] = &mut pyramids;
        after.renew(&pair.0, &pair.1, levels);
        build_ms.push(start.elapsed().as_secs_f64() * 1e3);
        let start = Instant::now();
        count += stereo_tracks(before, after, &rig, Hints::default(), &options).len();
        track_ms.push(start.elapsed().as_secs_f64() * 1e3);
        pyramids.swap(0, 1);
    }
    let middle = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        (times[0], times[times.len() / 2])
    };
    let ((build, build_median), (track, track_median)) = (middle(&mut build_ms), middle(&mut track_ms));
    println!("{} {build} {build_median} {track} {track_median}", count / (frames - 1));
}
