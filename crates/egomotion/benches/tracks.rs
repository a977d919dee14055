//! Each step of sparse tracking on one street pair: `cargo bench -p egomotion --bench tracks`.
//!
//! Needs real images: KITTI odometry sequence 06 under `EGOMOTION_DATA` or `../shared/data`.

mod street;

use criterion::Criterion;
use egomotion::estimate::{MaximumLikelihoodOptions, maximum_likelihood, robust_start};
use egomotion::observe::tracks::{
    Hints, SearchStart, TrackOptions, follow, stereo_corners, tracks_from_traces,
};
use egomotion::observe::{StereoPyramid, row_disagreement};

fn tracking(c: &mut Criterion) {
    let Some((images, rig)) = street::two_frames(0) else { return };
    let likelihood = MaximumLikelihoodOptions::default();
    let levels = TrackOptions::default().pyramid_levels;
    let mut before = StereoPyramid::new(&images[0], &images[1], levels);
    let after = StereoPyramid::new(&images[2], &images[3], levels);
    c.bench_function("pyramids", |b| b.iter(|| before.renew(&images[0], Some(&images[1]), levels)));
    for corners in [1200, 2000] {
        let options = TrackOptions { corners, ..TrackOptions::default() };
        let mut group = c.benchmark_group(format!("{corners}"));
        let none = Hints::default();
        group.bench_function("corners, new", |b| {
            b.iter(|| stereo_corners(&before, &[], &rig, none, &options))
        });
        let new = stereo_corners(&before, &[], &rig, none, &options);
        let far = SearchStart::Level(usize::MAX);
        group.bench_function("follow, nothing known", |b| {
            b.iter(|| follow(&before, &after, &new, &rig, none, far, &options));
        });
        let tracks = tracks_from_traces(&follow(&before, &after, &new, &rig, none, far, &options), &rig);
        group.bench_function("robust start", |b| b.iter(|| robust_start(&tracks, &rig, None, &likelihood)));
        let start = robust_start(&tracks, &rig, None, &likelihood).unwrap();
        group.bench_function("maximum likelihood", |b| {
            b.iter(|| maximum_likelihood(&tracks, &rig, &start, None, &likelihood.kernel));
        });
        let motion =
            maximum_likelihood(&tracks, &rig, &start, None, &likelihood.kernel).unwrap().motion.phi();
        let known = Hints { motion: Some(&motion), ..none };
        group.bench_function("follow, motion known", |b| {
            b.iter(|| follow(&before, &after, &new, &rig, known, SearchStart::FullResolution, &options));
        });
        let kept: Vec<_> = follow(&before, &after, &new, &rig, known, SearchStart::FullResolution, &options)
            .iter()
            .map(|trace| trace.after)
            .collect();
        group.bench_function("corners, most kept", |b| {
            b.iter(|| stereo_corners(&after, &kept, &rig, none, &options))
        });
        group.bench_function("row disagreement", |b| b.iter(|| row_disagreement(&before, &tracks, &rig)));
        group.finish();
    }
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    tracking(&mut criterion);
    criterion.final_summary();
}
