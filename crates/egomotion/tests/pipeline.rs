//! The whole way from images to motion, on small rendered sequences whose truth is known.

use egomotion::estimate::Estimate;
use egomotion::geometry::{Gaussian, Grid, Image, RigErrors, Twist};
use egomotion::metrics::Nees;
use egomotion::motion::NoObstacle;
use egomotion::pipeline::StageTimes;
use egomotion::pipeline::solve::BiasCause;
use egomotion::pipeline::{
    Approach, Config, FrameMotion, Method, Observe, StereoFrame, StereoMotion, Trajectory, Unanswered,
};
use egomotion::sim::{SensorNoise, Sequence};
use nalgebra::{Matrix6, Vector6};

const STILL_PAIRS: usize = 24;

fn sequence(name: &str, frames: usize) -> Sequence {
    Sequence::named(name, Some((320, 240)), Some(frames), 1.0).unwrap()
}

/// Frame `k` as the noisy sensor sees it, `interval_s` after the one before.
fn frame(sequence: &Sequence, k: usize) -> StereoFrame {
    let images = SensorNoise::default().with_seed(7).expose(&sequence.view(k).unwrap().render(2), k as u64);
    StereoFrame { time_s: sequence.interval_s * k as f64, left: images.left, right: images.right }
}

fn config(observe: Observe) -> Config {
    Config { observe, ..Config::default() }
}

fn sparse(sequence: &Sequence) -> StereoMotion {
    StereoMotion::new(sequence.rig, config(Observe::Sparse)).unwrap()
}

fn code(answer: &FrameMotion) -> &'static str {
    answer.motion.as_ref().err().map_or("ok", Unanswered::code)
}

/// What the error of the answer displaces in the image of a point 2 m away, in pixels; 0.1 px is far below what a
/// wrong interval or a wrong frame would leave (2 px and more), and above the sub-pixel bias of so small images.
fn error_px(answer: &FrameMotion, truth: &Twist, focal_px: f64) -> f64 {
    let error = answer.motion.as_ref().unwrap().theta.mean - truth.vector();
    focal_px * (error.fixed_rows::<3>(0).norm() / 2.0).max(error.fixed_rows::<3>(3).norm())
}

const CLOSE_PX: f64 = 0.1;

#[test]
fn bad_frames_are_bridged() {
    let sequence = sequence("C", 4);
    let frames: Vec<StereoFrame> = (0..4).map(|k| frame(&sequence, k)).collect();
    let constant = Image::filled(320, 240, 90.0);
    let mut not_numbers = frames[1].right.clone();
    not_numbers.set(100, 100, f32::NAN);
    let bad: [(&str, StereoFrame, &str); 7] = [
        ("black", StereoFrame { left: Image::filled(320, 240, 0.0), ..frames[1].clone() }, "bad_image"),
        ("constant", StereoFrame { right: constant, ..frames[1].clone() }, "bad_image"),
        ("not numbers", StereoFrame { right: not_numbers, ..frames[1].clone() }, "bad_image"),
        ("size", StereoFrame { left: Image::filled(319, 240, 3.0), ..frames[1].clone() }, "bad_image"),
        ("same time", StereoFrame { time_s: 0.0, ..frames[1].clone() }, "bad_time"),
        ("back in time", StereoFrame { time_s: -3.0, ..frames[1].clone() }, "bad_time"),
        ("no time", StereoFrame { time_s: f64::NAN, ..frames[1].clone() }, "bad_time"),
    ];
    let twice = sequence.phi(0).unwrap().scaled(2.0);
    for (name, spoilt, why) in bad {
        let (mut motion, mut trajectory) = (sparse(&sequence), Trajectory::new());
        let first = motion.push(frames[0].clone());
        assert_eq!((first.frame, first.reference, code(&first)), (0, None, "first"), "{name}");
        let unanswered = motion.push(spoilt);
        assert_eq!((unanswered.frame, unanswered.reference, code(&unanswered)), (1, Some(0), why), "{name}");
        assert_eq!(motion.reference(), Some(0), "{name}");
        let bridge = motion.push(frames[2].clone());
        assert_eq!((bridge.frame, bridge.reference, bridge.dt_s), (2, Some(0), Some(2.0)), "{name}");
        let error = error_px(&bridge, &twice, sequence.rig.focal_px);
        assert!(error < CLOSE_PX, "{name} {error}");
        for answer in [&first, &unanswered, &bridge] {
            trajectory.push(answer);
        }
        assert_eq!(trajectory.poses().len(), 3);
        let finite = |v: &f64| v.is_finite();
        for pose in trajectory.poses() {
            assert!(
                pose.translation.iter().all(finite) && pose.rotation.iter().all(finite),
                "{name} {pose:?}"
            );
        }
        // The frame without an answer lies between its neighbours.
        let along = |k: usize| trajectory.poses()[k].translation.norm();
        assert!(along(1) <= along(2), "{name}: {} {}", along(1), along(2));
        let after = motion.push(frames[3].clone());
        assert_eq!((after.frame, after.reference, after.dt_s), (3, Some(2), Some(1.0)), "{name}");
    }
}

#[test]
fn skipped_frames_count() {
    let sequence = sequence("C", 3);
    let mut motion = sparse(&sequence);
    motion.push(frame(&sequence, 0));
    let skipped = motion.skip(1.0, Unanswered::MissingRight);
    assert_eq!((skipped.frame, code(&skipped), skipped.reference), (1, "missing_right", Some(0)));
    let bridge = motion.push(frame(&sequence, 2));
    assert_eq!((bridge.frame, bridge.reference, bridge.dt_s, code(&bridge)), (2, Some(0), Some(2.0), "ok"));
}

/// A frame of noise, which has nothing in common with any other.
fn noise(like: &StereoFrame) -> StereoFrame {
    let seed = (10.0 * like.time_s) as u32;
    let grey = |u: usize, v: usize| {
        let mixed = (u as u32 ^ (v as u32) << 12 ^ seed << 24).wrapping_mul(0x9e37_79b1);
        ((mixed ^ mixed >> 15).wrapping_mul(0x85eb_ca6b) >> 24) as f32
    };
    let image = Grid::from_fn(320, 240, grey);
    StereoFrame { left: image.clone(), right: image, ..like.clone() }
}

#[test]
fn any_number_of_bad_frames_is_bridged() {
    let sequence = sequence("C", 2);
    let mut motion = sparse(&sequence);
    let good = [0, 1].map(|k| frame(&sequence, k));
    motion.push(good[0].clone());
    for k in 1..6 {
        let time_s = f64::from(k);
        let unanswered = motion.push(noise(&StereoFrame { time_s, ..good[0].clone() }));
        assert!(unanswered.motion.is_err(), "{k}");
        assert_eq!((unanswered.reference, motion.reference()), (Some(0), Some(0)), "{k}");
    }
    let bridge = motion.push(StereoFrame { time_s: 6.0, ..good[1].clone() });
    assert_eq!((bridge.frame, bridge.reference, bridge.dt_s), (6, Some(0), Some(6.0)));
    let error = error_px(&bridge, &sequence.phi(0).unwrap(), sequence.rig.focal_px);
    assert!(error < CLOSE_PX, "{error}");
}

#[test]
fn a_bad_first_frame_is_left() {
    let sequence = sequence("C", 4);
    let mut motion = sparse(&sequence);
    let frames: [StereoFrame; 4] = std::array::from_fn(|k| frame(&sequence, k));
    motion.push(noise(&frames[0]));
    let answers = [1, 2, 3].map(|k: usize| motion.push(frames[k].clone()));
    assert_eq!(answers.each_ref().map(|answer| answer.motion.is_ok()), [false, false, true]);
    assert_eq!((answers[2].frame, answers[2].reference, motion.reference()), (3, Some(2), Some(3)));
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let sequence = sequence("C", 2);
    let frames = [0, 1].map(|k| frame(&sequence, k));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut motion = StereoMotion::new(sequence.rig, config(Observe::Dense)).unwrap();
            motion.push(frames[0].clone());
            motion.push(frames[1].clone())
        })
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one.motion.unwrap(), two.motion.unwrap());
    assert_eq!(one.obstacle, two.obstacle);
    let (one, two) = (one.dense.unwrap(), two.dense.unwrap());
    // NaN is unlike itself: bits are compared.
    let bits = |grid: &Grid<f32>| grid.values().iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
    let maps = |d: &egomotion::pipeline::DenseResults| {
        let m = &d.motion;
        let fields = [
            &d.disparity.shift,
            &d.disparity.sigma,
            &d.flow.u,
            &d.flow.v,
            &m.depth_velocity,
            &m.depth_velocity_sigma,
            &m.looming,
            &m.looming_sigma,
        ];
        fields.map(|field| bits(field.grid()))
    };
    assert!(one.motion.depth_velocity.density() > 0.5, "{}", one.motion.depth_velocity.density());
    assert!(maps(&one) == maps(&two));
}

#[test]
fn masked_pixels_are_never_used() {
    let sequence = sequence("C", 2);
    let (first, clean) = (frame(&sequence, 0), frame(&sequence, 1));
    // A bonnet that does not move with the scene: the lower third of the second frame is that of the first.
    let mut bonnet = clean.clone();
    for v in 160..240 {
        bonnet.left.row_mut(v).copy_from_slice(first.left.row(v));
        bonnet.right.row_mut(v).copy_from_slice(first.right.row(v));
    }
    // Eight rows more than the bonnet, for the windows that reach over its edge.
    let mask = Grid::from_fn(320, 240, |_, v| v >= 152);
    for observe in [Observe::Sparse, Observe::Dense] {
        let run = |second: &StereoFrame, mask: Option<&Grid<bool>>| {
            let mut motion = StereoMotion::new(sequence.rig, config(observe)).unwrap();
            motion.set_mask(mask.cloned());
            motion.push(first.clone());
            motion.push(second.clone())
        };
        let phi = |answer: &FrameMotion| answer.motion.as_ref().unwrap().theta;
        let apart = |a: &Gaussian<6>, b: &Gaussian<6>| {
            (a.mean - b.mean).component_div(&a.cov.diagonal().map(f64::sqrt)).amax()
        };
        let masked = run(&clean, Some(&mask));
        let change = apart(&phi(&masked), &phi(&run(&bonnet, Some(&mask))));
        let seen = apart(&phi(&run(&clean, None)), &phi(&run(&bonnet, None)));
        println!("a bonnet changes φ by {change:.3} σ behind the mask, by {seen:.1} σ without");
        assert!(change < 0.5 && seen > 4.0 * change, "{observe:?} {change} {seen}");
        if let Some(dense) = &masked.dense {
            let count =
                |v: usize| (0..320).filter(|&u| dense.motion.depth_velocity.get(u, v).is_some()).count();
            assert_eq!((152..240).map(count).sum::<usize>(), 0);
            assert!((60..140).map(count).sum::<usize>() > 80 * 160);
        }
    }
}

/// A camera that stands still, new noise in every frame: the motion is zero within its covariance.
fn still(observe: Observe, pairs: usize) -> Nees {
    let sequence = sequence("still", 1);
    let images = sequence.view(0).unwrap().render(3);
    let mut nees = Nees::default();
    for pair in 0..pairs as u64 {
        // Both frames of a pair are new, so that pairs are independent.
        let mut motion = StereoMotion::new(sequence.rig, config(observe)).unwrap();
        let answers = [0, 1].map(|k| {
            let seen = SensorNoise::default().with_seed(11).expose(&images, 2 * pair + k);
            motion.push(StereoFrame { time_s: k as f64, left: seen.left, right: seen.right })
        });
        nees.add(&answers[1].motion.as_ref().unwrap().theta, &Vector6::zeros());
    }
    assert_eq!((nees.count, nees.refused), (pairs, 0));
    nees
}

/// NEES/6 within 0.5 … 1.7: four standard errors of 24 pairs are 0.47, the rest is what the block-wise covariance
/// of one frame is allowed to be off by.
#[test]
fn a_still_camera_is_still_within_its_covariance() {
    let nees = still(Observe::Sparse, STILL_PAIRS).per_degree().unwrap();
    println!("still, sparse: NEES/6 {nees:.2}");
    assert!((0.5..1.7).contains(&nees), "{nees}");
}

#[test]
fn a_still_camera_is_still_by_dense_observations() {
    let nees = still(Observe::Dense, STILL_PAIRS).per_degree().unwrap();
    println!("still, dense: NEES/6 {nees:.2}");
    assert!((0.5..1.7).contains(&nees), "{nees}");
}

// ---- trajectory ----

pub fn answer(
    frame: usize,
    time_s: f64,
    reference: Option<(usize, f64)>,
    motion: Result<Twist, Unanswered>,
) -> FrameMotion {
    FrameMotion {
        frame,
        reference: reference.map(|(k, _)| k),
        time_s,
        dt_s: reference.map(|(_, start)| time_s - start),
        motion: motion.map(|phi| Estimate {
            theta: Gaussian { mean: phi.vector(), cov: Matrix6::identity() },
            observed: [true; 6],
            undetermined: Default::default(),
            rows: 100,
            inliers: 90,
            residual_scale: 1.0,
        }),
        parts: None,
        rig_sigma: RigErrors::default(),
        row_disagreement_px: None,
        contradiction: None,
        obstacle: Err(NoObstacle::NothingMeasured),
        moving: Vec::new(),
        dense: None,
        stages: StageTimes::default(),
    }
}

#[test]
fn poses_between_are_interpolated_in_time() {
    let phi = Twist::from_vector(&Vector6::new(0.1, -0.2, -0.9, 0.05, 0.4, -0.1));
    let bad = || Err(Unanswered::BadTime);
    let mut trajectory = Trajectory::new();
    trajectory.push(&answer(0, 10.0, None, Err(Unanswered::First)));
    trajectory.push(&answer(1, 11.0, Some((0, 10.0)), Ok(phi)));
    // Bridged from frame 1 at 11 s to frame 5 at 15 s; the frames between came when they came.
    for (k, time_s) in [(2, 11.5), (3, f64::NAN), (4, 99.0)] {
        trajectory.push(&answer(k, time_s, Some((1, 11.0)), bad()));
        assert_eq!(trajectory.poses()[k], trajectory.poses()[1], "it stands until it knows better");
    }
    trajectory.push(&answer(5, 15.0, Some((1, 11.0)), Ok(phi)));
    // The camera moves by the inverse of the scene's motion.
    let camera = |share: f64| phi.scaled(share).exp().inverse();
    let want = [
        camera(0.0),
        camera(1.0),
        camera(1.0).after(&camera(0.125)),
        // A time that is no number, and one beyond the interval: at its ends.
        camera(1.0),
        camera(2.0),
        camera(2.0),
    ];
    for (k, (got, want)) in trajectory.poses().iter().zip(want).enumerate() {
        assert!((got.translation - want.translation).norm() < 1e-12, "{k} {got:?} {want:?}");
        assert!((got.rotation - want.rotation).norm() < 1e-12, "{k}");
    }
    assert_eq!(trajectory.times_s().len(), 6);
}

/// Where the motion is small no method is contradicted; at sixteen times of it those that linearise are, and the cause is
/// the one that the motion has.
#[test]
fn corners_contradict_a_method_that_cannot_hold() {
    let cause = |method: Method, step: f64| {
        let sequence = Sequence::named("drive", Some((320, 240)), Some(2), step).unwrap();
        let config = Config { method, approach: Approach::Differential, ..Config::default() };
        let mut motion = StereoMotion::new(sequence.rig, config).unwrap();
        motion.push(frame(&sequence, 0));
        let answer = motion.push(frame(&sequence, 1));
        assert!(answer.motion.is_ok(), "{method:?} {step}");
        answer.contradiction.map(|contradiction| contradiction.cause)
    };
    assert_eq!([cause(Method::Dcce, 1.0), cause(Method::Dv, 1.0)], [None, None]);
    let far = cause(Method::Dcce, 16.0);
    assert!(matches!(far, Some(BiasCause::LongDisplacement { pixels }) if pixels > 20.0), "{far:?}");
    let fast = cause(Method::Dv, 16.0);
    assert!(matches!(fast, Some(BiasCause::FastApproach { share }) if share > 0.1), "{fast:?}");
}
