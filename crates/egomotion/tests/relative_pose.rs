//! The covariance of any pose relative to any other, against a simulation of what makes it wrong: noise that neighbouring
//! pairs share, and errors that all pairs share.

use crate::pipeline;
use egomotion::estimate::{CovarianceParts, MATCHING_ERRORS};
use egomotion::geometry::{RIG_ERRORS, RigErrors, RigidMotion, Twist};
use egomotion::pipeline::{FrameMotion, Trajectory, Unanswered};
use nalgebra::{Matrix6, SMatrix, SVector, Vector6};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const FRAMES: usize = 9;
const DRAWS: usize = 4000;

/// Errors of φ of each pair: A of the noise of its earlier frame, B of its later one; R of the rig, M of matching.
struct World {
    earlier: Matrix6<f64>,
    later: Matrix6<f64>,
    rig: SMatrix<f64, 6, RIG_ERRORS>,
    matching: SMatrix<f64, 6, MATCHING_ERRORS>,
    sigma: SVector<f64, RIG_ERRORS>,
}

fn normal<const R: usize, const C: usize>(rng: &mut Pcg64Mcg, scale: f64) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|_, _| scale * rng.sample::<f64, _>(StandardNormal))
}

impl World {
    fn new(rng: &mut Pcg64Mcg) -> Self {
        let earlier = normal::<6, 6>(rng, 1e-3);
        // What is wrong in a frame moves its two pairs in opposite ways.
        let later = -0.8 * earlier + normal::<6, 6>(rng, 3e-4);
        let sigma = SVector::repeat(1e-3);
        Self { earlier, later, rig: normal(rng, 0.3), matching: normal(rng, 2e-4), sigma }
    }

    fn parts(&self, with_previous: bool) -> CovarianceParts {
        let own = self.earlier * self.earlier.transpose() + self.later * self.later.transpose();
        // φ of the pair before has B of the frame that this one has A of.
        let shared = self.later * self.earlier.transpose();
        CovarianceParts {
            own,
            with_previous: if with_previous { shared } else { Matrix6::zeros() },
            phi_per_matching_sigma: self.matching,
            phi_per_rig_error: self.rig,
        }
    }

    /// Errors of φ of all pairs.
    fn errors(&self, rng: &mut Pcg64Mcg) -> Vec<Vector6<f64>> {
        let noise: Vec<Vector6<f64>> = (0..FRAMES).map(|_| normal(rng, 1.0)).collect();
        let shared = self.rig * normal::<RIG_ERRORS, 1>(rng, 1.0).component_mul(&self.sigma)
            + self.matching * normal::<MATCHING_ERRORS, 1>(rng, 1.0);
        noise.windows(2).map(|n| self.earlier * n[0] + self.later * n[1] + shared).collect()
    }
}

fn motions() -> Vec<Twist> {
    (0..FRAMES - 1)
        .map(|k| {
            let turn = 0.2 * (0.7 * k as f64).sin();
            Twist::from_vector(&Vector6::new(0.02, -0.01, -0.3, 0.02, turn, -0.01))
        })
        .collect()
}

/// φ of the frames `reference` to `frame`, a tenth of a second each.
fn answer(
    frame: usize,
    reference: usize,
    phi: &Twist,
    parts: CovarianceParts,
    sigma: &RigErrors,
) -> FrameMotion {
    let time_s = |k: usize| 0.1 * k as f64;
    let known = pipeline::answer(frame, time_s(frame), Some((reference, time_s(reference))), Ok(*phi));
    FrameMotion { parts: Some(parts), rig_sigma: *sigma, ..known }
}

fn lost(frame: usize, why: Unanswered) -> FrameMotion {
    pipeline::answer(frame, 0.1 * frame as f64, None, Err(why))
}

/// The trajectory of motions; neighbours share the noise of their common frame, or count as independent.
fn trajectory(world: &World, phis: &[Twist], neighbours_share: bool) -> Trajectory {
    let sigma = RigErrors::from_vector(&world.sigma);
    let mut trajectory = Trajectory::new();
    trajectory.push(&lost(0, Unanswered::First));
    for (k, phi) in phis.iter().enumerate() {
        trajectory.push(&answer(k + 1, k, phi, world.parts(neighbours_share && k > 0), &sigma));
    }
    trajectory
}

#[test]
fn any_relative_pose_has_the_covariance_of_simulated_errors() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let (world, phis) = (World::new(&mut rng), motions());
    let truth = trajectory(&world, &phis, true);
    let pairs = [(0, 1), (0, 2), (0, FRAMES - 1), (3, 7), (7, 3)];
    let mut sums = pairs.map(|_| Matrix6::<f64>::zeros());
    for _ in 0..DRAWS {
        let errors = world.errors(&mut rng);
        let wrong: Vec<Twist> = phis
            .iter()
            .zip(&errors)
            .map(|(phi, error)| Twist::from_vector(&(phi.vector() + error)))
            .collect();
        let wrong = trajectory(&world, &wrong, true);
        for (sum, &(i, j)) in sums.iter_mut().zip(&pairs) {
            let relative = |t: &Trajectory| -> RigidMotion { t.relative(i, j).unwrap().pose };
            let delta = relative(&wrong).inverse().after(&relative(&truth)).log().vector();
            *sum += delta * delta.transpose();
        }
    }
    for (sum, &(i, j)) in sums.iter().zip(&pairs) {
        let stated = truth.relative(i, j).unwrap().cov;
        // Whitened by what is stated, the covariance of the draws is I: an entry scatters by √(2/n) = 0.022, and 0.12 is
        // five times that.
        let root = stated.cholesky().unwrap().l().try_inverse().unwrap();
        let white = root * (sum / DRAWS as f64) * root.transpose();
        assert!((white - Matrix6::identity()).amax() < 0.12, "{i} {j}: {white:.3}");
    }
}

#[test]
fn what_neighbours_share_makes_poses_more_certain() {
    let (world, phis) = (World::new(&mut Pcg64Mcg::seed_from_u64(5)), motions());
    let sum = |share: bool| trajectory(&world, &phis, share).relative(0, 2).unwrap().cov;
    assert!(sum(true).trace() < 0.8 * sum(false).trace());
}

#[test]
fn what_nothing_bridges_is_unknown_and_what_is_interpolated_is_not() {
    let world = World::new(&mut Pcg64Mcg::seed_from_u64(6));
    let sigma = RigErrors::from_vector(&world.sigma);
    let phi = motions()[0];
    let mut trajectory = Trajectory::new();
    trajectory.push(&lost(0, Unanswered::First));
    trajectory.push(&answer(1, 0, &phi, world.parts(false), &sigma));
    // The frame 2 is lost, and 3 bridges it; nothing bridges the frames 4 and 5.
    trajectory.push(&lost(2, Unanswered::MissingRight));
    let faster = Twist::from_vector(&(2.3 * phi.vector()));
    trajectory.push(&answer(3, 1, &faster, world.parts(true), &sigma));
    trajectory.push(&lost(4, Unanswered::MissingRight));
    trajectory.push(&lost(5, Unanswered::MissingRight));
    trajectory.push(&answer(6, 5, &phi, world.parts(false), &sigma));
    let known = |cov: &Matrix6<f64>| cov.iter().all(|v| v.is_finite());
    let all: Vec<Matrix6<f64>> = trajectory.covariances_from(0).collect();
    assert_eq!(all.iter().map(known).collect::<Vec<_>>(), [true, true, true, true, false, false, false]);
    assert_eq!(all[0], Matrix6::zeros());
    // Halfway the velocity may have been another one.
    let between = trajectory.relative(1, 2).unwrap().cov;
    let half = trajectory.relative(1, 3).unwrap().cov * 0.25;
    assert!(between[(2, 2)] > half[(2, 2)]);
    assert!(known(&trajectory.relative(5, 6).unwrap().cov));
    assert!(!known(&trajectory.relative(6, 0).unwrap().cov));
    assert!(trajectory.relative(0, 7).is_none());
}
