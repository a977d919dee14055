//! From dense fields to motion and maps on one street pair: `cargo bench -p egomotion --bench estimate`.
//!
//! Needs real images: KITTI odometry sequence 06 under `EGOMOTION_DATA` or `../shared/data`.

mod street;

use criterion::Criterion;
use egomotion::estimate::systematic::common_errors;
use egomotion::geometry::Twist;
use egomotion::motion::depth_velocity::{DisparityOffset, RigidPrediction};
use egomotion::observe::tracks::{Hints, stereo_tracks};
use egomotion::observe::{DensePair, DisparityMatcher, StereoPyramid, dense_flow};
use egomotion::pipeline::Config;
use egomotion::pipeline::maps::motion_maps;
use egomotion::pipeline::solve::{Observed, solve};

fn estimation(c: &mut Criterion) {
    let Some((images, rig)) = street::two_frames(4) else { return };
    let config = Config::default();
    let pyramids = |i: usize| StereoPyramid::new(&images[i], &images[i + 1], config.tracks.pyramid_levels);
    let (before, after) = (pyramids(0), pyramids(2));
    let mut matcher = DisparityMatcher::new(config.disparity.clone());
    let mut disparity = |i: usize| matcher.compute(&images[i], &images[i + 1]).unwrap();
    let maps = (disparity(0), disparity(2));
    let flow = dense_flow(&before.left, &after.left, None, &config.flow).unwrap();
    let tracks = stereo_tracks(&before, &after, &rig, Hints::default(), &config.tracks);
    let pair = DensePair { rig: &rig, before: &maps.0, after: &maps.1, flow: &flow, flow_right: None };
    let start = solve(&Observed::Sparse(&tracks), &rig, &Twist::zero(), &config).unwrap().phi();

    c.bench_function("dense observations", |b| {
        b.iter(|| pair.every(config.sample_step_px, DensePair::stereo_track));
    });
    c.bench_function("solve, dense", |b| {
        b.iter(|| solve(&Observed::Dense(pair, &tracks), &rig, &start, &config));
    });
    let motion = solve(&Observed::Dense(pair, &tracks), &rig, &start, &config).unwrap();
    let kernel = &config.maximum_likelihood.kernel;
    c.bench_function("common errors of tracks", |b| {
        b.iter(|| common_errors(&tracks, &rig, &motion.phi(), kernel));
    });
    let common = common_errors(&tracks, &rig, &motion.phi(), kernel).unwrap();
    let offset = DisparityOffset { sigma_px: 0.1, phi_per_px: common.by_disparity_offset };
    let rigid = RigidPrediction::new(&motion.theta, offset, &rig).unwrap();
    c.bench_function("maps", |b| b.iter(|| motion_maps(&pair, Some(&rigid), None, &config, 0.1)));
}

fn main() {
    let mut criterion = Criterion::default().sample_size(30).configure_from_args();
    estimation(&mut criterion);
    criterion.final_summary();
}
