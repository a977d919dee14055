//! Dense flow on one street pair: `cargo bench -p egomotion --bench flow`.
//!
//! Needs real images: KITTI odometry sequence 06 under `EGOMOTION_DATA` or `../shared/data`.

mod street;

use criterion::Criterion;
use egomotion::geometry::Twist;
use egomotion::observe::flow::{FlowPair, FlowSpace, Side, rigid_flow};
use egomotion::observe::{DisparityMatcher, DisparityOptions, FlowOptions, StereoPyramid};
use nalgebra::Vector3;

const LEVELS: usize = 6;

fn flow(c: &mut Criterion) {
    let Some((images, rig)) = street::two_frames(0) else { return };
    let disparity =
        DisparityMatcher::new(DisparityOptions::default()).compute(&images[0], &images[1]).unwrap();
    // About what the car does here from frame to frame.
    let phi = Twist { t: Vector3::new(0.0, 0.0, -1.17), omega: Vector3::zeros() };
    let [before, after] = [0, 2].map(|k| StereoPyramid::new(&images[k], &images[k + 1], LEVELS));
    for camera in [Side::Left, Side::Right] {
        c.bench_function(&format!("rigid flow, {camera:?}"), |b| {
            b.iter(|| rigid_flow(&disparity, &rig, &phi, camera));
        });
    }
    let prediction = rigid_flow(&disparity, &rig, &phi, Side::Left);
    let mut space = FlowSpace::default();
    let pair = FlowPair { from: &before.left, to: &after.left, to_spline: Some(&after.left_spline) };
    let options = FlowOptions::default();
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
