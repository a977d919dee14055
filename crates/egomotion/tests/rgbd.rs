//! A depth camera through the pipeline, on rendered scenes whose depth and motion are known.

use egomotion::estimate::Tolerance;
use egomotion::geometry::{Field, Grid, Image, Twist};
use egomotion::metrics::Nees;
use egomotion::observe::DisparityMap;
use egomotion::pipeline::{
    Config, DepthCamera, DepthNoise, Frame, FrameMotion, Method, Observe, RgbdMotion, StereoFrame,
    StereoMotion, Unanswered,
};
use egomotion::sim::{SensorNoise, Sequence};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

const NOISE: DepthNoise = DepthNoise::StructuredLight { per_m: 1.4e-3, step_per_m: 0.0 };

fn sequence(frames: usize) -> Sequence {
    Sequence::named("C", Some((320, 240)), Some(frames), 1.0).unwrap()
}

fn camera(sequence: &Sequence) -> DepthCamera {
    DepthCamera { rig: sequence.rig, noise: NOISE }
}

/// The image of frame `k`, and its depth with the noise of the sensor.
fn frame(sequence: &Sequence, k: usize, seed: u64) -> (Image, Field) {
    let view = sequence.view(k).unwrap();
    let image = SensorNoise::default().with_seed(seed).expose(&view.render(2), k as u64).left;
    let exact = view.truth_maps(None).depth;
    let mut rng = Pcg64Mcg::seed_from_u64(1000 * seed + k as u64);
    let unit = Normal::new(0.0, 1.0).unwrap();
    let depth = Grid::from_fn(exact.width(), exact.height(), |u, v| {
        exact
            .get(u, v)
            .map_or(f32::NAN, |z| (f64::from(z) + NOISE.sigma_m(f64::from(z)) * unit.sample(&mut rng)) as f32)
    });
    (image, Field::from_grid(depth))
}

/// What an error displaces in the image of a point 2 m away, in pixels.
fn error_px(answer: &FrameMotion, truth: &Twist, focal_px: f64) -> f64 {
    let error = answer.motion.as_ref().unwrap().theta.mean - truth.vector();
    focal_px * (error.fixed_rows::<3>(0).norm() / 2.0).max(error.fixed_rows::<3>(3).norm())
}

/// The second answer of a pair of frames, changed before they are pushed.
fn pair(
    sequence: &Sequence,
    config: Config,
    seed: u64,
    change: impl Fn(&mut Image, &mut Field),
) -> FrameMotion {
    let mut motion = RgbdMotion::new(camera(sequence), config).unwrap();
    let mut answer = None;
    for k in 0..2 {
        let (mut image, mut depth) = frame(sequence, k, seed);
        change(&mut image, &mut depth);
        answer = Some(motion.push(k as f64, image, &depth));
    }
    answer.unwrap()
}

/// Stereo's error on the same pair.
fn stereo_error_px(sequence: &Sequence, seed: u64) -> f64 {
    let mut motion = StereoMotion::new(sequence.rig, Config::default()).unwrap();
    let mut push = |k: usize| {
        let view = sequence.view(k).unwrap();
        let seen = SensorNoise::default().with_seed(seed).expose(&view.render(2), k as u64);
        motion.push(StereoFrame { time_s: k as f64, left: seen.left, right: seen.right })
    };
    push(0);
    error_px(&push(1), &sequence.phi(0).unwrap(), sequence.rig.focal_px)
}

/// Stereo's own bound on these images is 0.1 px (tests/pipeline.rs); depth must not be much worse than stereo is.
#[test]
fn motion_is_as_good_as_stereos_and_its_covariance_true() {
    let sequence = sequence(2);
    let truth = sequence.phi(0).unwrap();
    let (mut nees, mut by_depth, mut by_stereo) = (Nees::default(), 0.0, 0.0);
    // This camera takes all rows at once, and depth with them: allowing for the contrary costs half of the precision.
    let tolerance = Tolerance { readout_s: 0.0, delay_s: 0.0, ..NOISE.tolerance() };
    let dense = Config { tolerance, ..Config::default() };
    for seed in 0..12 {
        let answer = pair(&sequence, dense.clone(), seed, |_, _| {});
        let error = error_px(&answer, &truth, sequence.rig.focal_px);
        assert!(error < 0.1, "{seed} {error}");
        by_depth += error;
        by_stereo += stereo_error_px(&sequence, seed);
        nees.add(&answer.motion.unwrap().theta, &truth.vector());
        let sparse = Config { observe: Observe::Sparse, ..dense.clone() };
        let error = error_px(&pair(&sequence, sparse, seed, |_, _| {}), &truth, sequence.rig.focal_px);
        assert!(error < 0.1, "sparse {seed} {error}");
    }
    assert!(by_depth < 1.5 * by_stereo, "{by_depth} {by_stereo}");
    // 72 degrees of freedom: 0.4 … 2.5 allows for the bias of so small images.
    let per_degree = nees.per_degree().unwrap();
    assert!((0.4..2.5).contains(&per_degree), "NEES/6 {per_degree}");
}

#[test]
fn shape_alone_answers_where_there_is_no_texture() {
    let sequence = sequence(3);
    // Corners and flow find nothing in a gradient, whose light grows, nor in one grey level that never changes.
    let gradient = |k: usize| Grid::from_fn(320, 240, |u, _| 20.0 + 0.5 * u as f32 + k as f32);
    let constant = |_: usize| Grid::filled(320, 240, 90.0);
    let images: [&dyn Fn(usize) -> Image; 2] = [&gradient, &constant];
    for image in images {
        let mut motion = RgbdMotion::new(camera(&sequence), Config::default()).unwrap();
        motion.push(0.0, image(0), &frame(&sequence, 0, 3).1);
        for k in 1..3 {
            let truth = sequence.phi(k - 1).unwrap();
            let answer = motion.push(k as f64, image(k), &frame(&sequence, k, 3).1);
            let estimate = answer.motion.as_ref().unwrap();
            assert!(estimate.is_complete());
            let deviation = (estimate.theta.mean - truth.vector()).norm();
            assert!(deviation < 0.25 * truth.vector().norm(), "{k}: {deviation} {}", truth.vector().norm());
        }
        let copy = motion.push(3.0, image(2), &frame(&sequence, 2, 3).1);
        assert_eq!(copy.motion.unwrap_err(), Unanswered::RepeatedFrame);
    }
    // Without depth there is nothing to see.
    let mut stereo = StereoMotion::new(sequence.rig, Config::default()).unwrap();
    let blank = StereoFrame { time_s: 0.0, left: constant(0), right: constant(0) };
    assert_eq!(stereo.push(blank).motion.unwrap_err().code(), "bad_image");
}

#[test]
fn missing_depth_is_missing_and_no_more() {
    let sequence = sequence(2);
    let truth = sequence.phi(0).unwrap();
    let hole = |_: &mut Image, depth: &mut Field| {
        for v in 60..180 {
            for u in 100..200 {
                depth.set(u, v, None);
            }
        }
    };
    let answer = pair(&sequence, Config::default(), 5, hole);
    assert!(error_px(&answer, &truth, sequence.rig.focal_px) < 0.15);
    let maps = answer.dense.unwrap();
    assert_eq!(maps.disparity.shift.get(150, 120), None);
    assert_eq!(maps.motion.depth_velocity.get(150, 120), None);
    assert!(maps.motion.depth_velocity.density() > 0.5);
    // Nothing at all: a reason, and no panic.
    let none = pair(&sequence, Config::default(), 5, |_, depth| *depth = Field::missing(320, 240));
    assert_eq!(none.motion.unwrap_err().code(), "few_rows");
    for method in [Method::Dcce, Method::Dv, Method::Rigid] {
        let answer = pair(&sequence, Config { method, ..Config::default() }, 5, hole);
        assert!(answer.motion.is_ok(), "{method:?}");
    }
}

#[test]
fn given_maps_that_are_our_own_change_nothing() {
    let sequence = sequence(2);
    let images = |k: usize| SensorNoise::default().expose(&sequence.view(k).unwrap().render(2), k as u64);
    let mut own = StereoMotion::new(sequence.rig, Config::default()).unwrap();
    let frames: Vec<StereoFrame> = (0..2)
        .map(|k| {
            let seen = images(k);
            StereoFrame { time_s: k as f64, left: seen.left, right: seen.right }
        })
        .collect();
    own.push(frames[0].clone());
    let expected = own.push(frames[1].clone());
    // The later frame's own map comes from a pair that begins with it.
    let mut later = StereoMotion::new(sequence.rig, Config::default()).unwrap();
    later.push(frames[1].clone());
    let map_of_later = later.push(StereoFrame { time_s: 9.0, ..frames[0].clone() }).dense.unwrap().disparity;
    let maps = expected.dense.as_ref().unwrap();
    let given = |frame: &StereoFrame, disparity: &DisparityMap, flow| Frame {
        disparity: Some(disparity.clone()),
        flow,
        ..frame.clone().into()
    };
    let mut again = StereoMotion::new(sequence.rig, Config::default()).unwrap();
    again.push(given(&frames[0], &maps.disparity, Some(maps.flow.clone())));
    let answer = again.push(given(&frames[1], &map_of_later, None));
    assert_eq!(answer.motion.unwrap().theta, expected.motion.unwrap().theta);
    assert_eq!(answer.dense.unwrap().motion.depth_velocity.count(), maps.motion.depth_velocity.count());
}

#[test]
fn a_copied_frame_is_bridged() {
    let sequence = sequence(3);
    let mut motion = RgbdMotion::new(camera(&sequence), Config::default()).unwrap();
    let (first, second) = (frame(&sequence, 0, 1), frame(&sequence, 2, 1));
    motion.push(0.0, first.0.clone(), &first.1);
    let copy = motion.push(1.0, first.0, &first.1);
    assert_eq!(copy.motion.unwrap_err(), Unanswered::RepeatedFrame);
    let bridge = motion.push(2.0, second.0, &second.1);
    assert_eq!((bridge.reference, bridge.dt_s), (Some(0), Some(2.0)));
    let twice = sequence.phi(0).unwrap().scaled(2.0);
    assert!(error_px(&bridge, &twice, sequence.rig.focal_px) < 0.3);
}
