//! The metrics against an independent program, and on cases whose answer is known.
use approx::assert_relative_eq;
use egomotion::geometry::{Gaussian, RigidMotion};
use egomotion::metrics::{
    Coverage, Delta, KITTI_LENGTHS_M, Nees, SectionSeven, TrajectoryAlignment, align, associate, kitti_drift,
    pairs, quantile, relative_pose_error, travelled_m,
};
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Turned by yaw about Y, then by pitch about X.
fn pose(yaw: f64, pitch: f64, translation: [f64; 3]) -> RigidMotion {
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), yaw);
    let rotation = turn * Rotation3::from_axis_angle(&Vector3::x_axis(), pitch);
    RigidMotion { rotation: rotation.into_inner(), translation: translation.into() }
}

fn truth() -> Vec<RigidMotion> {
    (0..34).map(f64::from).map(|k| pose(0.02 * k, 0.003 * k, [0.01 * k * k, -0.02 * k, 1.3 * k])).collect()
}

fn estimate() -> Vec<RigidMotion> {
    let at = |k: u32| {
        let [n, n2, n3, n4, n5] = [k, k % 2, k % 3, k % 4, k % 5].map(f64::from);
        let translation = [0.0101 * n * n + 0.01 * n4, -0.02 * n + 0.004 * n5, 1.31 * n - 0.03 * n2];
        pose(0.0202 * n + 0.001 * n3, 0.003 * n - 0.0005 * n2, translation)
    };
    (0..34).map(at).collect()
}

// Expected values of the next two tests: the project's reference script `evaluate.py` (numpy, 4×4
// matrices; its functions `rpe` and `kitti`), run on the same trajectories built there by numpy.

#[test]
fn relative_pose_error_is_that_of_the_reference_script() {
    let error = relative_pose_error(&estimate(), &truth()).unwrap();
    assert_relative_eq!(error.t_rmse_m, 0.037073919027557925, max_relative = 1e-10);
    assert_relative_eq!(error.t_median_m, 0.026883802038068436, max_relative = 1e-10);
    assert_relative_eq!(error.t_max_m, 0.055577116528769795, max_relative = 1e-10);
    assert_relative_eq!(error.r_rmse_deg, 0.08670424673707422, max_relative = 1e-8);
    assert_relative_eq!(error.r_median_deg, 0.07448451270955214, max_relative = 1e-8);
    assert_relative_eq!(error.r_max_deg, 0.10703734835383266, max_relative = 1e-8);
    assert_eq!(error.steps, 33);
}

#[test]
fn drift_is_that_of_the_reference_script() {
    let drift = kitti_drift(&estimate(), &truth(), &[5.0, 10.0, 20.0, 40.0]).unwrap();
    assert_relative_eq!(drift.percent, 0.8815213295150737, max_relative = 1e-10);
    assert_relative_eq!(drift.deg_per_m, 0.012427257617047074, max_relative = 1e-8);
    assert_eq!(drift.segments, 9);
    let short = kitti_drift(&estimate(), &truth(), &[3.9, 2.6]).unwrap();
    assert_relative_eq!(short.percent, 0.9332575007611181, max_relative = 1e-10);
    assert_relative_eq!(short.deg_per_m, 0.022264735637773418, max_relative = 1e-8);
    assert_eq!(short.segments, 8);
    assert_relative_eq!(*travelled_m(&truth()).last().unwrap(), 44.68201565736906, max_relative = 1e-12);
    assert_eq!(kitti_drift(&estimate(), &truth(), &KITTI_LENGTHS_M), None);
}

#[test]
fn a_segment_ends_beyond_its_length_not_at_it() {
    let straight =
        |speed: f64| (0..12).map(|k| pose(0.0, 0.0, [0.0, 0.0, speed * f64::from(k)])).collect::<Vec<_>>();
    // 4 m need the fifth step of 1 m, since the fourth ends exactly at 4 m: the error is 5 × 0.1 m.
    let drift = kitti_drift(&straight(1.1), &straight(1.0), &[4.0]).unwrap();
    assert_relative_eq!(drift.percent, 100.0 * 0.5 / 4.0, max_relative = 1e-12);
    assert_eq!((drift.segments, drift.deg_per_m), (1, 0.0));
}

#[test]
fn trajectories_without_a_step_have_no_error() {
    assert_eq!(relative_pose_error(&estimate()[..1], &truth()), None);
    assert_eq!(relative_pose_error(&[], &[]), None);
    assert_eq!(kitti_drift(&[], &truth(), &[5.0]), None);
    assert_eq!(kitti_drift(&estimate(), &truth(), &[0.0, -1.0, f64::NAN]), None);
    assert!(travelled_m(&[]).is_empty());
    let mut broken = estimate();
    broken[3].rotation = Matrix3::from_element(f64::NAN);
    assert!(relative_pose_error(&broken, &truth()).unwrap().t_rmse_m.is_nan());
}

#[test]
fn section_seven_by_hand() {
    // Relative errors +10 %, −20 %, +40 %; the last two points are too small or unknown.
    let pairs = [(-1.1, -1.0), (1.6, 2.0), (1.4, 1.0), (0.5, 0.1), (f64::NAN, 1.0)];
    let figures = SectionSeven::of(&pairs).unwrap();
    assert_relative_eq!(figures.erm_signed_percent.unwrap(), 10.0, max_relative = 1e-12);
    assert_relative_eq!(figures.erm_abs_percent.unwrap(), 70.0 / 3.0, max_relative = 1e-12);
    assert_relative_eq!(figures.erm_median_percent.unwrap(), 20.0, max_relative = 1e-12);
    assert_relative_eq!(figures.std_percent.unwrap(), 30.0, max_relative = 1e-12);
    assert_relative_eq!(figures.eam, (0.1 + 0.4 + 0.4 + 0.4) / 4.0, max_relative = 1e-12);
    assert_relative_eq!(figures.eam_median, 0.4, max_relative = 1e-12);
    assert_eq!((figures.count, figures.relative_count), (4, 3));

    let at_rest = SectionSeven::of(&[(0.3, 0.0), (-0.1, 0.0)]).unwrap();
    assert_eq!((at_rest.erm_signed_percent, at_rest.erm_abs_percent), (None, None));
    assert_relative_eq!(at_rest.eam, 0.2, max_relative = 1e-12);
    assert_eq!(SectionSeven::of(&[(f64::NAN, 1.0)]), None);
}

#[test]
fn nees_and_coverage_of_a_true_covariance() {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
    let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
    let (mut nees, mut coverage) = (Nees::default(), Coverage::default());
    let truth = Vector2::new(3.0, -1e-3);
    for _ in 0..4000 {
        let (a, b) = (draw(), draw());
        // Metres and radians, correlated: covariance L Lᵀ with L = [2 0; 3e-6 4e-6].
        let mean = truth + Vector2::new(2.0 * a, 3e-6 * a + 4e-6 * b);
        let cov = nalgebra::Matrix2::new(4.0, 6e-6, 6e-6, 25e-12);
        nees.add(&Gaussian { mean, cov }, &truth);
        coverage.add(mean.x - 1.96 * 2.0, mean.x + 1.96 * 2.0, truth.x);
    }
    let error = nees.standard_error().unwrap();
    assert!((nees.per_degree().unwrap() - 1.0).abs() < 4.0 * error, "{nees:?}");
    assert!((error - (2.0f64 / 8000.0).sqrt()).abs() < 1e-15);
    // Binomial standard error of a share of .95 in 4000 is .0034.
    assert!((coverage.share().unwrap() - 0.95).abs() < 4.0 * 0.0034, "{coverage:?}");
}

#[test]
fn unusable_covariances_and_intervals_do_not_count() {
    let mut nees = Nees::default();
    nees.add(&Gaussian::independent([1.0, 2.0], [0.0, 1.0]), &Vector2::zeros());
    assert_eq!((nees.refused, nees.count, nees.per_degree()), (1, 0, None));
    let mut coverage = Coverage::default();
    for (lo, hi) in [(0.0, f64::INFINITY), (2.0, 3.0), (-1.0, 0.5), (f64::NAN, 2.0), (1.0, 1.0)] {
        coverage.add(lo, hi, 1.0);
    }
    assert_eq!(coverage, Coverage { inside: 2, below: 1, above: 1 });
}

#[test]
fn quantiles_interpolate() {
    assert_eq!(quantile(&[4.0, 1.0, 3.0, 2.0], 0.5), Some(2.5));
    assert_eq!(quantile(&[4.0, 1.0, 3.0], 0.5), Some(3.0));
    assert_eq!(quantile(&[4.0, 1.0], 1.0), Some(4.0));
    assert_relative_eq!(quantile(&[0.0, 10.0], 0.99).unwrap(), 9.9, max_relative = 1e-12);
    assert_eq!(quantile(&[], 0.5), None);
}

#[test]
fn stamps_are_associated_with_the_nearest() {
    let truth = [0.0, 0.1, 0.2, 0.3, 0.4];
    assert_eq!(associate(&[0.104, 0.38, 0.9], &truth, 0.025), [(0, 1), (1, 4)]);
    // Of two at the same distance the earlier one; the shorter list asks, whichever it is.
    assert_eq!(associate(&[0.25], &[0.0, 0.125, 0.375], 1.0), [(0, 1)]);
    assert_eq!(associate(&truth, &[0.11, 0.19], 0.05), [(1, 0), (2, 1)]);
    assert!(associate(&[], &truth, 1.0).is_empty() && associate(&truth, &[], 1.0).is_empty());
}

#[test]
fn pairs_follow_each_other() {
    let truth = truth();
    let times: Vec<f64> = (0..truth.len()).map(|k| 0.1 * k as f64).collect();
    assert_eq!(pairs(Delta::Frames(12), &truth, &[]), [(0, 12), (12, 24)]);
    assert_eq!(pairs(Delta::Seconds(1.0), &truth, &times), [(0, 10), (10, 20), (20, 30)]);
    let travelled = travelled_m(&truth);
    for (i, j) in pairs(Delta::Metres(5.0), &truth, &[]) {
        assert!(travelled[j] - travelled[i] >= 5.0 && travelled[j - 1] - travelled[i] < 5.0);
    }
    assert!(
        pairs(Delta::Metres(0.0), &truth, &[]).is_empty() && pairs(Delta::Frames(1), &[], &[]).is_empty()
    );
}

#[test]
fn a_moved_and_scaled_trajectory_is_laid_back() {
    let (truth, world) = (truth(), pose(0.7, -1.2, [3.0, -2.0, 11.0]));
    let moved: Vec<RigidMotion> = truth
        .iter()
        .map(|p| {
            let moved = world.after(p);
            RigidMotion { translation: moved.translation * 0.25, ..moved }
        })
        .collect();
    let found = align(&moved, &truth, TrajectoryAlignment::Sim3).unwrap();
    assert_relative_eq!(found.scale, 4.0, max_relative = 1e-9);
    for (moved, truth) in moved.iter().zip(&truth) {
        let back = found.apply(moved);
        assert!((back.translation - truth.translation).norm() < 1e-9);
        assert!((back.rotation - truth.rotation).amax() < 1e-9);
    }
    assert_eq!(align(&moved, &truth, TrajectoryAlignment::Se3).unwrap().scale, 1.0);
    // A line leaves the turn about it open.
    let line: Vec<RigidMotion> = (0..5).map(|k| pose(0.0, 0.0, [0.0, 0.0, f64::from(k)])).collect();
    assert_eq!(align(&line, &line, TrajectoryAlignment::Se3), None);
}
