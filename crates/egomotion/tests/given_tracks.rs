//! Tracks that others made: motion, copies, and gaps.

use egomotion::geometry::{RigidMotion, StereoRig, Twist};
use egomotion::pipeline::{Config, TrackMotion, TrackPoint, Trajectory, Unanswered};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

fn rig() -> StereoRig {
    StereoRig::new(700.0, (600.0, 180.0), 0.5, (1200, 360)).unwrap()
}

fn phi() -> Twist {
    Twist { t: Vector3::new(0.02, -0.01, -0.8), omega: Vector3::new(0.001, 0.01, -0.002) }
}

/// What a camera sees of fixed points after `k` steps, with noise of 0.1 px; numbers from `first`.
fn points(k: u32, first: u64, seed: u64) -> Vec<TrackPoint> {
    let mut rng = Pcg64Mcg::seed_from_u64(first);
    let mut noise_of = Pcg64Mcg::seed_from_u64(1 + seed);
    let noise = Normal::new(0.0, 0.1).unwrap();
    let motion = (0..k).fold(RigidMotion::identity(), |at, _| phi().exp().after(&at));
    (0..120)
        .map(|i| {
            let point = Vector3::new(
                rng.random_range(-8.0..8.0),
                rng.random_range(-2.0..2.0),
                rng.random_range(12.0..40.0),
            );
            let seen = rig().project(&motion.apply(&point)).unwrap();
            let (u, v) = rig().pixel_from_image(seen.x, seen.y);
            let mut jitter = |c: f64| c + noise.sample(&mut noise_of);
            TrackPoint {
                track: first + i,
                left: (jitter(u), jitter(v)),
                right: (jitter(u - seen.z), jitter(v)),
            }
        })
        .collect()
}

#[test]
fn motion_is_found_with_a_true_scale_of_its_noise() {
    let mut motion = TrackMotion::new(rig(), Config::default()).unwrap();
    assert_eq!(motion.push(0.0, &points(0, 0, 0)).motion.unwrap_err(), Unanswered::First);
    let answer = motion.push(0.1, &points(1, 0, 1));
    let estimate = answer.motion.unwrap();
    let error = estimate.theta.mean - phi().vector();
    for i in 0..6 {
        assert!(error[i].abs() < 4.0 * estimate.theta.sigma(i), "{i} {error} {}", estimate.theta.cov);
    }
    assert!(estimate.theta.sigma(2) < 0.05 && estimate.theta.sigma(2) > 1e-4);
    assert!(answer.row_disagreement_px.unwrap() < 0.1);
    assert_eq!(motion.push(0.1, &points(2, 0, 2)).motion.unwrap_err(), Unanswered::BadTime);
}

#[test]
fn a_pure_copy_is_bridged() {
    let mut motion = TrackMotion::new(rig(), Config::default()).unwrap();
    let first = points(0, 0, 0);
    motion.push(0.0, &first);
    assert_eq!(motion.push(0.1, &first).motion.unwrap_err(), Unanswered::RepeatedFrame);
    let bridge = motion.push(0.2, &points(2, 0, 2));
    assert_eq!(bridge.reference, Some(0));
    let found = bridge.motion.unwrap().phi().vector();
    assert!((found - phi().scaled(2.0).vector()).norm() < 0.05, "{found}");
}

#[test]
fn copies_beside_new_tracks_lose_one_interval_which_goes_on_as_before() {
    let mut motion = TrackMotion::new(rig(), Config::default()).unwrap();
    let mut trajectory = Trajectory::new();
    let second = points(1, 0, 1);
    // The third frame repeats the second's tracks; new ones begin in it, and they alone go on.
    let third = [second.clone(), points(2, 1000, 2)].concat();
    let frames = [points(0, 0, 0), second, third, points(3, 1000, 3)];
    let mut codes = Vec::new();
    for (k, frame) in frames.iter().enumerate() {
        let answer = motion.push(0.1 * k as f64, frame);
        trajectory.push(&answer);
        codes.push(answer.motion.err().map_or("ok", |why| why.code()));
    }
    assert_eq!(codes, ["first", "ok", "repeated_frame", "ok"]);
    let expected = (0..3).fold(RigidMotion::identity(), |at, _| at.after(&phi().exp().inverse()));
    let off = trajectory.poses()[3].translation - expected.translation;
    assert!(off.norm() < 0.05, "{off}");
}
