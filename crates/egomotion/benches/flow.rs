//! Dense flow on one street pair: `cargo bench -p egomotion --bench flow`.
//!
//! Needs real images: KITTI odometry sequence 06 under `EGOMOTION_DATA` or `../shared/data`.

use std::path::PathBuf;

use criterion::Criterion;
use egomotion::geometry::{Image, StereoRig, Twist};
use egomotion::observe::flow::{Camera, FlowPair, FlowSpace, rigid_flow};
use egomotion::observe::spline::coefficients;
use egomotion::observe::{DisparityMatcher, DisparityOptions, FlowOptions, StereoPyramid};
use nalgebra::Vector3;

const LEVELS: usize = 6;

fn image(side: usize, frame: usize) -> Option<Image> {
    let data = std::env::var_os("EGOMOTION_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = data.join(format!("kitti_odometry/sequences/06/image_{side}/{frame:06}.png"));
    egomotion_io::image::read(&path).ok()
}

fn flow(c: &mut Criterion) {
    let images: Option<Vec<Image>> =
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(s, f)| image(s, f)).into_iter().collect();
    let Some(images) = images else {
        println!("SKIPPED: no KITTI odometry sequence 06");
        return;
    };
    let rig = StereoRig::new(707.0912, (601.8873, 183.1104), 0.5372, images[0].size()).unwrap();
    let disparity =
        DisparityMatcher::new(DisparityOptions::default()).compute(&images[0], &images[1]).unwrap();
    // About what the car does here from frame to frame.
    let phi = Twist { t: Vector3::new(0.0, 0.0, -1.17), omega: Vector3::zeros() };
    let [before, after] = [0, 2].map(|k| StereoPyramid::new(&images[k], &images[k + 1], LEVELS));
    for camera in [Camera::Left, Camera::Right] {
        c.bench_function(&format!("rigid flow, {camera:?}"), |b| {
            b.iter(|| rigid_flow(&disparity, &rig, &phi, camera));
        });
    }
    let prediction = rigid_flow(&disparity, &rig, &phi, Camera::Left);
    let mut space = FlowSpace::default();
    let pair = FlowPair { from: &before.left, to: &after.left, to_spline: Some(&after.left_spline) };
    let options = FlowOptions::default();
    c.bench_function("spline of the level where the search ends", |b| {
        b.iter(|| coefficients(&after.left.levels()[options.finest_search_level]));
    });
    c.bench_function("flow, predicted", |b| b.iter(|| pair.flow(Some(&prediction), &options, &mut space)));
    c.bench_function("flow, free", |b| b.iter(|| pair.flow(None, &options, &mut space)));
    let one_way = FlowOptions { consistency_px: f32::INFINITY, ..options };
    c.bench_function("flow, free, one way", |b| b.iter(|| pair.flow(None, &one_way, &mut space)));
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    flow(&mut criterion);
    criterion.final_summary();
}
