//! Rigs that are not as stated: what is known of them is taken away, and what is not widens the covariance.

use egomotion::estimate::{MotionEstimate, RigPrior};
use egomotion::geometry::{RigErrors, Twist};
use egomotion::pipeline::{Config, Observe, StereoFrame, StereoMotion};
use egomotion::sim::{SensorNoise, Sequence};

/// Two frames of a drive by a rig with these errors, as a pipeline that is told `prior` answers them, and the truth.
fn answered(errors: RigErrors, prior: RigPrior, observe: Observe) -> (MotionEstimate, Twist) {
    let sequence = Sequence::named("drive", Some((320, 240)), Some(2), 1.0).unwrap().with_rig_errors(errors);
    let config = Config { observe, rig_errors: prior, ..Config::default() };
    let mut motion = StereoMotion::new(sequence.rig, config).unwrap();
    let mut push = |k: usize| {
        let images = SensorNoise::default().expose(&sequence.view(k).unwrap().render(2), k as u64);
        motion.push(StereoFrame { time_s: k as f64, left: images.left, right: images.right })
    };
    push(0);
    let found = push(1).motion.unwrap();
    let pose = |k: usize| sequence.world_from_left(k).unwrap();
    (found, pose(1).inverse().after(&pose(0)).log())
}

fn yaw(degrees: f64) -> RigErrors {
    RigErrors { yaw_rad: degrees.to_radians(), ..RigErrors::default() }
}

#[test]
fn a_known_yaw_is_taken_away() {
    for observe in [Observe::Sparse, Observe::Dense] {
        let off = |prior: RigPrior| {
            let (found, truth) = answered(yaw(0.1), prior, observe);
            (found.phi().t.z / truth.t.z - 1.0).abs()
        };
        let (told, untold) = (off(RigPrior { yaw_deg: 0.1, ..RigPrior::exact() }), off(RigPrior::exact()));
        assert!(untold > 0.01 && told < 0.1 * untold, "{observe:?}: {told} {untold}");
    }
}

#[test]
fn an_unknown_yaw_is_in_the_covariance() {
    let sigmas = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let nees = |prior: RigPrior| {
        let (found, truth) = answered(yaw(0.1), prior, Observe::Sparse);
        found.theta.mahalanobis2(&truth.vector()).unwrap()
    };
    let (stated, exact) = (nees(RigPrior::exact().with_sigmas(sigmas)), nees(RigPrior::exact()));
    assert!(stated < 20.0 && exact > 100.0, "{stated} {exact}");
}
