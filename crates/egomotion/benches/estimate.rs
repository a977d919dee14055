//! From dense fields to motion and maps on one street pair: `cargo bench -p egomotion --bench estimate`.
//!
//! Least median of squares is timed on rows made at random; the rest
//! needs real images: KITTI odometry sequence 06 under `EGOMOTION_DATA` or `../shared/data`.

mod street;

use criterion::Criterion;
use egomotion::estimate::{
    LmedsOptions, Row, TrackSource, Weighting, best_subset, best_subset_plain, lmeds, random_subsets,
    subsets_needed, systematic_response,
};
use egomotion::motion::{RigUncertainty, RigidPrediction};
use egomotion::observe::tracks::{Hints, stereo_tracks};
use egomotion::observe::{DensePair, DisparityMatcher, StereoPyramid, dense_flow};
use egomotion::pipeline::plan::Interval;
use egomotion::pipeline::solve::{Observed, solve};
use egomotion::pipeline::{Config, motion_maps};
use nalgebra::Vector6;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

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
    let pair = DensePair {
        rig: &rig,
        before: &maps.0,
        after: &maps.1,
        flow: &flow,
        flow_right: None,
        external_disparity: false,
    };
    let interval = Interval::new(&rig, &config, TrackSource::Stereo, 0.1);
    let start = solve(&Observed::Tracks(&tracks), &interval, None).unwrap().motion.phi();

    c.bench_function("dense observations", |b| {
        b.iter(|| pair.every(config.sample_step_px, DensePair::stereo_track));
    });
    c.bench_function("solve, dense", |b| {
        b.iter(|| solve(&Observed::Fields(pair, &tracks), &interval, Some(&start)));
    });
    let solved = solve(&Observed::Fields(pair, &tracks), &interval, Some(&start)).unwrap();
    let motion = solved.motion;
    let kernel = &config.maximum_likelihood.kernel;
    c.bench_function("systematic response of tracks", |b| {
        b.iter(|| systematic_response(&tracks, &rig, &motion.phi(), kernel));
    });
    let uncertainty = RigUncertainty {
        sigma: config.rig_errors.sigma(0.1, &config.tolerance, &rig),
        phi_per_error: solved.phi_per_rig_error.unwrap(),
    };
    let rigid = RigidPrediction::new(&motion.theta, &uncertainty, &rig).unwrap();
    c.bench_function("maps", |b| b.iter(|| motion_maps(&pair, Some(&rigid), None, &interval)));
}

/// Equations in six unknowns, a share of them outliers.
fn random_rows(count: usize, outliers: f64) -> Vec<Row<6>> {
    let mut rng = Pcg64Mcg::seed_from_u64(58);
    let truth = Vector6::new(0.01, -0.01, -0.015, 0.002, 0.002, 0.001);
    let row = |block| {
        let a = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let noise: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
        let far = if rng.random_bool(outliers) { rng.random_range(-0.1..0.1) } else { 0.0 };
        Row { a, b: a.dot(&truth) + 0.002 * noise + far, sigma: 0.002, block }
    };
    (0..count).map(row).collect()
}

/// 300,000 rows, P = .99, ε = .5: 293 subsets of six.
fn least_median(c: &mut Criterion) {
    let options = LmedsOptions::default();
    for outliers in [0.0, 0.4] {
        let rows = random_rows(300_000, outliers);
        let count = subsets_needed(options.confidence, options.outliers, 6);
        let subsets = || random_subsets::<6>(rows.len(), count, options.seed);
        let found = best_subset(&rows, Weighting::Unit, subsets());
        assert_eq!(found, best_subset_plain(&rows, Weighting::Unit, subsets()));
        let name = |what: &str| format!("LMedS, {what}, {:.0} % outliers", 100.0 * outliers);
        c.bench_function(&name("search"), |b| b.iter(|| best_subset(&rows, Weighting::Unit, subsets())));
        c.bench_function(&name("search and refit"), |b| b.iter(|| lmeds(&rows, Weighting::Unit, &options)));
    }
}

fn main() {
    let mut criterion = Criterion::default().sample_size(30).configure_from_args();
    least_median(&mut criterion);
    estimation(&mut criterion);
    criterion.final_summary();
}
