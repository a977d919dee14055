//! Times the pipeline and a formula: `time_pipeline FOLDER FRAMES THREADS`, JSON on one line.
//!
//! `bench/python.py` runs it beside the Python package: `push_ms` of each of the first FRAMES frames of a stereo sequence,
//! images in memory already, and `formula_ms` of repeats of VZ with its variance, (21) and (50), of a million points.

use std::path::Path;
use std::time::Instant;

use egomotion::geometry::Gaussian;
use egomotion::motion::depth_velocity::dv_discrete;
use egomotion::observe::StereoTrack;
use egomotion::pipeline::{Config, StereoFrame, StereoMotion};
use egomotion_io::Source;
use egomotion_io::recording::Reader;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;

const POINTS: usize = 1_000_000;
const REPEATS: usize = 10;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, folder, frames, threads] = &arguments[..] else {
        println!("usage: time_pipeline FOLDER FRAMES THREADS");
        return;
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.parse().unwrap());
    pool.build_global().unwrap();
    let times = serde_json::json!({
        "push_ms": pushes(Path::new(folder), frames.parse().unwrap()),
        "formula_ms": formula(),
    });
    println!("{times}");
}

fn milliseconds(since: Instant) -> f64 {
    1e3 * since.elapsed().as_secs_f64()
}

fn pushes(folder: &Path, frames: usize) -> Vec<f64> {
    let source = Source::open(folder).unwrap();
    let sequence = &source.sequences[0];
    let read = |k: usize| {
        let (left, right) = Reader::pair(sequence, &sequence.frames[k]).unwrap();
        StereoFrame { time_s: 0.1 * k as f64, left, right }
    };
    let images: Vec<StereoFrame> = (0..frames).map(read).collect();
    let mut motion = StereoMotion::new(sequence.rig.unwrap(), Config::default()).unwrap();
    let push = |frame| {
        let begun = Instant::now();
        let answer = motion.push(frame);
        let ms = milliseconds(begun);
        drop(answer);
        ms
    };
    images.into_iter().map(push).collect()
}

fn formula() -> Vec<f64> {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let mut point = || {
        let [x, y, d] = [(1000.0, 0.0), (300.0, 0.0), (60.0, 5.0)].map(|(scale, least)| {
            let unit: f64 = rng.random();
            scale * unit + least
        });
        Gaussian::independent([x, y, d], [0.01, 0.01, 0.02])
    };
    let tracks: Vec<StereoTrack> =
        (0..POINTS).map(|_| StereoTrack { before: point(), after: point() }).collect();
    let once = |_| {
        let begun = Instant::now();
        let both = tracks.par_iter().with_min_len(1024).map(|track| dv_discrete(track, 380.0).vz());
        let (values, variances): (Vec<f64>, Vec<f64>) = both.map(|vz| (vz.value(), vz.variance())).unzip();
        let ms = milliseconds(begun);
        assert_eq!(values.len(), variances.len());
        ms
    };
    (0..REPEATS).map(once).collect()
}
