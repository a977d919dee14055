//! Every estimator finds the exact answer of exact observations, says what cannot be observed, and
//! withstands what does not belong.

use crate::scattered::{self, normals, phi, places, plane, random, rig, stereo_flow, track};
use egomotion::constrain::{binocular_flow, dcce, image_flow};
use egomotion::estimate::alignment::{Fitting, Form, PointPair, align};
use egomotion::estimate::{
    Blocks, LinearFit, LmedsOptions, MaximumLikelihoodOptions, MotionEstimate, Row, StudentT, Unsolvable,
    Weighting, least_squares, lmeds, m_estimate, maximum_likelihood, robust_start, two_step,
};
use egomotion::geometry::{Gaussian, StereoRig, Twist};
use egomotion::observe::{StereoFlow, StereoTrack};
use egomotion::pipeline::Config;
use egomotion::pipeline::config::EstimatorKind;
use egomotion::pipeline::solve::Solver;
use nalgebra::{Matrix3, SVector, Vector3, Vector6};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

const EXACT: f64 = 1e-9;

#[track_caller]
fn recovers(found: &Vector6<f64>, truth: &Twist) {
    let error = (found - truth.vector()).amax();
    assert!(error < EXACT, "off by {error:e}: {found}");
}

/// Depth changes at places with slopes of all directions, as rows of (11).
fn depth_rows(seen: &[(Vector3<f64>, [f64; 2])], phi: &Twist, rig: &StereoRig) -> Vec<Row<6>> {
    let blocks = Blocks::tiling(rig, 32.0);
    seen.iter()
        .map(|(xyd, slope)| {
            let change =
                scattered::depth_flow(xyd, *slope, phi, rig).depth_change(rig.depth_disparity_product());
            Row::from_constraint(&dcce::constraint(&change, rig.focal_px, phi), blocks.index(xyd.x, xyd.y))
        })
        .collect()
}

fn scattered_depth_rows(count: usize, phi: &Twist, rig: &StereoRig, rng: &mut Pcg64Mcg) -> Vec<Row<6>> {
    let seen: Vec<_> =
        places(count, rng).into_iter().map(|xyd| (xyd, (normals::<2>(rng) * 0.1).into())).collect();
    depth_rows(&seen, phi, rig)
}

fn flows(count: usize, phi: &Twist, rig: &StereoRig, rng: &mut Pcg64Mcg) -> Vec<StereoFlow> {
    places(count, rng).iter().map(|xyd| stereo_flow(xyd, phi, rig, [0.01, 0.02, 0.02, 0.02])).collect()
}

/// Rows of (14) and of (3).
fn flow_rows(flows: &[StereoFlow], rig: &StereoRig) -> (Vec<Row<6>>, Vec<Row<6>>) {
    let blocks = Blocks::tiling(rig, 32.0);
    let block = |flow: &StereoFlow| blocks.index(flow.x_px, flow.y_px);
    let still = Twist::zero();
    let dv =
        |flow| Row::from_constraint(&binocular_flow::constraint_as_printed(flow, rig, &still), block(flow));
    let image =
        |flow| image_flow::constraints(flow, rig, &still).map(|c| Row::from_constraint(&c, block(flow)));
    (flows.iter().map(dv).collect(), flows.iter().flat_map(image).collect())
}

fn tracks(count: usize, phi: &Twist, rig: &StereoRig, rng: &mut Pcg64Mcg) -> Vec<StereoTrack> {
    places(count, rng).iter().map(|xyd| track(xyd, phi, rig, Matrix3::identity() * 0.01)).collect()
}

fn pairs(tracks: &[StereoTrack], rig: &StereoRig) -> Vec<PointPair> {
    let blocks = Blocks::tiling(rig, 32.0);
    tracks
        .iter()
        .map(|t| PointPair::from_track(t, rig, blocks.index(t.before.mean.x, t.before.mean.y)).unwrap())
        .collect()
}

/// The three estimators of linear rows, least squares in both weightings.
fn linear<const N: usize>(name: &str, rows: &[Row<N>]) -> Result<LinearFit<N>, Unsolvable> {
    match name {
        "ls" => least_squares(rows, Weighting::Unit),
        "wls" => least_squares(rows, Weighting::InverseVariance),
        "lmeds" => lmeds(rows, Weighting::Unit, &LmedsOptions::default()),
        _ => m_estimate(rows, &SVector::zeros(), &StudentT::default()),
    }
}

const LINEAR: [&str; 4] = ["ls", "wls", "lmeds", "irls"];

const GAUSSIAN: StudentT = StudentT { nu: f64::INFINITY, fitted: false, iterations: 100, tolerance: 1e-9 };

/// Motions from none to 20 pixels of flow.
fn motions() -> [Twist; 4] {
    [0.0, 0.1, 1.0, 5.0].map(|scale| phi().scaled(scale))
}

#[test]
fn linear_methods_recover_the_truth() {
    let (rig, mut rng) = (rig(), random(1));
    for phi in motions() {
        let depth = scattered_depth_rows(300, &phi, &rig, &mut rng);
        let (dv, image) = flow_rows(&flows(300, &phi, &rig, &mut rng), &rig);
        let all: Vec<Row<6>> = dv.iter().chain(&image).copied().collect();
        for name in LINEAR {
            let fit = linear(name, &depth).unwrap_or_else(|why| panic!("dcce {name} {phi:?}: {why}"));
            recovers(&fit.theta, &phi);
            let two = two_step(&dv, &image, |rows| linear(name, rows));
            let two = two.unwrap_or_else(|why| panic!("dv {name} {phi:?}: {why}"));
            recovers(&two.theta.mean, &phi);
            let joint = linear(name, &all).unwrap_or_else(|why| panic!("joint {name} {phi:?}: {why}"));
            recovers(&joint.theta, &phi);
            assert!(two.is_complete() && fit.estimate(&depth).is_complete());
        }
    }
}

/// Displacements of up to 32 steps of sequence C's kind, by every estimator: the mean point leaves no approximation.
#[test]
fn finite_displacements_recover_the_truth() {
    let (rig, mut rng) = (rig(), random(16));
    for step in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0] {
        // Away from the camera: no point gets behind it.
        let phi = phi().scaled(-step);
        let tracks = tracks(300, &phi, &rig, &mut rng);
        for estimator in [EstimatorKind::Ls, EstimatorKind::Irls, EstimatorKind::Lmeds] {
            let config = Config { estimator, ..Config::default() };
            let still = Twist::zero();
            let solver = Solver::new(&rig, &still, &config);
            for found in [solver.joint_displacement(&tracks), solver.binocular_displacement(&tracks)] {
                let found = found.unwrap_or_else(|why| panic!("{estimator:?} {step}: {why}"));
                recovers(&found.theta.mean, &phi);
                assert!(found.is_complete(), "{estimator:?} {step}");
            }
        }
    }
}

#[test]
fn alignments_recover_the_truth() {
    let (rig, mut rng) = (rig(), random(2));
    for phi in motions() {
        let pairs = pairs(&tracks(300, &phi, &rig, &mut rng), &rig);
        for form in [Form::Rigid, Form::Affine] {
            for fitting in [
                Fitting::LeastSquares,
                Fitting::Lmeds(LmedsOptions::default()),
                Fitting::MEstimator(StudentT::default()),
            ] {
                let found = align(&pairs, form, &fitting);
                recovers(&found.unwrap_or_else(|why| panic!("{form:?} {fitting:?}: {why}")).theta.mean, &phi);
            }
        }
    }
}

#[test]
fn maximum_likelihood_recovers_the_truth() {
    let (rig, mut rng) = (rig(), random(3));
    for phi in motions() {
        let (tracks, flows) = (tracks(200, &phi, &rig, &mut rng), flows(200, &phi, &rig, &mut rng));
        for kernel in [GAUSSIAN, StudentT::default()] {
            let start = Twist::zero();
            let discrete = maximum_likelihood(&tracks, &rig, &start, None, &kernel);
            recovers(&discrete.unwrap_or_else(|why| panic!("{kernel:?}: {why}")).motion.theta.mean, &phi);
            let differential = maximum_likelihood(&flows, &rig, &start, None, &kernel);
            recovers(&differential.unwrap_or_else(|why| panic!("{kernel:?}: {why}")).motion.theta.mean, &phi);
        }
        let start = robust_start(&tracks, &rig, None, &MaximumLikelihoodOptions::default()).unwrap();
        recovers(&start.vector(), &phi);
    }
}

#[test]
fn one_end_may_be_exact() {
    let (rig, mut rng) = (rig(), random(4));
    for exact_before in [true, false] {
        let mut tracks = tracks(100, &phi(), &rig, &mut rng);
        for track in &mut tracks {
            let end = if exact_before { &mut track.before } else { &mut track.after };
            end.cov = Matrix3::zeros();
        }
        let found = maximum_likelihood(&tracks, &rig, &Twist::zero(), None, &GAUSSIAN).unwrap();
        recovers(&found.motion.theta.mean, &phi());
    }
}

// ---- what cannot be observed ----

#[test]
fn too_few_rows_are_refused() {
    let (rig, mut rng) = (rig(), random(5));
    let rows = scattered_depth_rows(5, &phi(), &rig, &mut rng);
    for name in LINEAR {
        assert_eq!(linear(name, &rows).err(), Some(Unsolvable::FewRows { rows: 5, needed: 6 }), "{name}");
        assert!(linear::<6>(name, &[]).is_err());
    }
    let (dv, image) = flow_rows(&flows(2, &phi(), &rig, &mut rng), &rig);
    assert!(two_step(&dv, &image, |rows| linear("ls", rows)).is_err());
    let tracks = tracks(3, &phi(), &rig, &mut rng);
    let options = MaximumLikelihoodOptions::default();
    for few in 0..3 {
        let found = maximum_likelihood(&tracks[..few], &rig, &Twist::zero(), None, &GAUSSIAN);
        assert_eq!(found.err(), Some(Unsolvable::FewRows { rows: few, needed: 3 }));
        let found = maximum_likelihood(&tracks[..few], &rig, &Twist::zero(), None, &StudentT::default());
        assert!(matches!(found.err(), Some(Unsolvable::FewRows { needed: 3, .. })));
        assert!(matches!(
            robust_start(&tracks[..few], &rig, None, &options),
            Err(Unsolvable::FewRows { .. })
        ));
    }
    let pairs = pairs(&tracks, &rig);
    let refused = |n: usize, form| align(&pairs[..n], form, &Fitting::LeastSquares).err();
    assert_eq!(refused(2, Form::Rigid), Some(Unsolvable::FewRows { rows: 2, needed: 3 }));
    assert_eq!(refused(3, Form::Affine), Some(Unsolvable::FewRows { rows: 3, needed: 4 }));
    assert_eq!(refused(0, Form::Rigid), Some(Unsolvable::FewRows { rows: 0, needed: 3 }));
}

/// Observed components have the true value and a finite variance; the others 0 and an infinite one.
#[track_caller]
fn says_what_is_observed(found: &MotionEstimate, truth: &Twist, observed: [bool; 6]) {
    assert_eq!(found.observed, observed);
    for (i, is_observed) in observed.into_iter().enumerate() {
        let (value, variance) = (found.theta.mean[i], found.theta.cov[(i, i)]);
        if is_observed {
            assert!(
                (value - truth.vector()[i]).abs() < EXACT && variance.is_finite(),
                "{i}: {value} ± {variance}"
            );
        } else {
            assert!(value.is_nan() && variance == f64::INFINITY, "{i}: {value} ± {variance}");
        }
    }
}

#[test]
fn all_points_equal() {
    let rig = rig();
    let place = Vector3::new(31.0, -47.0, 19.0);
    let depth = depth_rows(&[(place, [0.1, -0.05]); 20], &phi(), &rig);
    for name in LINEAR {
        // One equation twenty times, in which all six are mixed.
        match linear(name, &depth) {
            Ok(fit) => {
                assert_eq!(fit.observability.rank(), 1, "{name}");
                says_what_is_observed(&fit.estimate(&depth), &phi(), [false; 6]);
            }
            Err(why) => assert_eq!(why, Unsolvable::Unobservable, "{name}"),
        }
    }
    let still = stereo_flow(&place, &phi(), &rig, [0.01; 4]);
    let (dv, image) = flow_rows(&[still; 20], &rig);
    if let Ok(two) = two_step(&dv, &image, |rows| linear("ls", rows)) {
        says_what_is_observed(&two, &phi(), [false; 6]);
    }
    let tracks = [track(&place, &phi(), &rig, Matrix3::identity() * 0.01); 20];
    let found = maximum_likelihood(&tracks, &rig, &Twist::zero(), None, &GAUSSIAN).unwrap();
    // The point's velocity is known, but every component of φ is mixed with another.
    says_what_is_observed(&found.motion, &phi(), [false; 6]);
    for form in [Form::Rigid, Form::Affine] {
        for fitting in [
            Fitting::LeastSquares,
            Fitting::Lmeds(LmedsOptions::default()),
            Fitting::MEstimator(StudentT::default()),
        ] {
            let refused = align(&pairs(&tracks, &rig), form, &fitting).err();
            assert_eq!(refused, Some(Unsolvable::Unobservable), "{form:?} {fitting:?}");
        }
    }
    assert!(robust_start(&tracks, &rig, None, &MaximumLikelihoodOptions::default()).is_err());
}

/// Places on a line in space that has all three directions and passes by the camera.
fn on_a_line(count: usize, rng: &mut Pcg64Mcg, rig: &StereoRig) -> Vec<Vector3<f64>> {
    (0..count)
        .map(|_| {
            let along: f64 = rng.random_range(0.0..1.0);
            rig.project(&Vector3::new(-0.7 + 1.2 * along, -0.4 + 0.9 * along, 2.0 + 1.5 * along)).unwrap()
        })
        .collect()
}

#[test]
fn points_on_a_line() {
    let (rig, mut rng) = (rig(), random(6));
    let line = on_a_line(60, &mut rng, &rig);
    // A turn about the line moves nothing and has all six components.
    let tracks: Vec<StereoTrack> =
        line.iter().map(|xyd| track(xyd, &phi(), &rig, Matrix3::identity() * 0.01)).collect();
    for kernel in [GAUSSIAN, StudentT::default()] {
        let found = maximum_likelihood(&tracks, &rig, &Twist::zero(), None, &kernel).unwrap();
        says_what_is_observed(&found.motion, &phi(), [false; 6]);
    }
    for form in [Form::Rigid, Form::Affine] {
        let refused = align(&pairs(&tracks, &rig), form, &Fitting::LeastSquares).err();
        assert_eq!(refused, Some(Unsolvable::Unobservable), "{form:?}");
    }
    let flows: Vec<StereoFlow> = line.iter().map(|xyd| stereo_flow(xyd, &phi(), &rig, [0.01; 4])).collect();
    let (dv, image) = flow_rows(&flows, &rig);
    let all: Vec<Row<6>> = dv.iter().chain(&image).copied().collect();
    let joint = linear("wls", &all).unwrap();
    assert_eq!(joint.observability.rank(), 5);
    says_what_is_observed(&joint.estimate(&all), &phi(), [false; 6]);
    // The first step knows one combination less than its three unknowns, and the second builds on it.
    let two = two_step(&dv, &image, |rows| linear("ls", rows)).unwrap();
    says_what_is_observed(&two, &phi(), [false; 6]);
}

#[test]
fn a_plane_of_points_is_enough_for_all_but_the_matrix() {
    let (rig, truth) = (rig(), phi());
    let seen = plane(&Vector3::new(0.1, -0.2, 1.0).normalize(), 3.0, 24, &rig);
    let tracks: Vec<StereoTrack> =
        seen.iter().map(|(xyd, _)| track(xyd, &truth, &rig, Matrix3::identity() * 0.01)).collect();
    let found = maximum_likelihood(&tracks, &rig, &Twist::zero(), None, &GAUSSIAN).unwrap();
    recovers(&found.motion.theta.mean, &truth);
    let pairs = pairs(&tracks, &rig);
    recovers(&align(&pairs, Form::Rigid, &Fitting::LeastSquares).unwrap().theta.mean, &truth);
    assert_eq!(align(&pairs, Form::Affine, &Fitting::LeastSquares).err(), Some(Unsolvable::Unobservable));
}

#[test]
fn depth_changes_of_planes_and_a_sphere() {
    let (rig, truth) = (rig(), phi());
    let wall = plane(&Vector3::z(), 3.0, 16, &rig);
    let ground = plane(&Vector3::y(), 0.9, 16, &rig);
    let slanted = plane(&Vector3::new(0.3, -0.4, 0.8).normalize(), 2.5, 16, &rig);
    let side = plane(&Vector3::x(), 1.0, 16, &rig);
    let parallel = plane(&Vector3::z(), 4.0, 16, &rig);
    let sphere: Vec<(Vector3<f64>, [f64; 2])> = sphere(&Vector3::new(0.1, -0.2, 3.0), 1.0, 12, &rig);
    let together = |parts: &[&Vec<(Vector3<f64>, [f64; 2])>]| -> Vec<(Vector3<f64>, [f64; 2])> {
        parts.iter().flat_map(|part| part.iter().copied()).collect()
    };
    let (yes, no) = (true, false);
    for (name, seen, rank, observed) in [
        // What slides along the wall and turns about its normal is unseen.
        ("wall", wall.clone(), 3, [no, no, yes, yes, yes, no]),
        ("two parallel walls", together(&[&wall, &parallel]), 3, [no, no, yes, yes, yes, no]),
        ("ground", ground.clone(), 3, [no, yes, no, yes, no, yes]),
        ("slanted plane", slanted.clone(), 3, [no; 6]),
        // Turns about its centre are unseen, and its centre lies off every axis.
        ("sphere", sphere, 3, [no; 6]),
        ("ground and wall", together(&[&ground, &wall]), 5, [no, yes, yes, yes, yes, yes]),
        ("wall and side", together(&[&wall, &side]), 5, [yes, no, yes, yes, yes, yes]),
        ("wall and slanted", together(&[&wall, &slanted]), 5, [no, no, yes, yes, yes, yes]),
        ("a corner of three", together(&[&wall, &ground, &side]), 6, [yes; 6]),
    ] {
        let rows = depth_rows(&seen, &truth, &rig);
        for estimator in ["ls", "wls", "irls"] {
            let fit = linear(estimator, &rows).unwrap_or_else(|why| panic!("{name} {estimator}: {why}"));
            assert_eq!(fit.observability.rank(), rank, "{name} {estimator}");
            says_what_is_observed(&fit.estimate(&rows), &truth, observed);
        }
    }
}

/// Places on a sphere with the gradient of disparity, from the surface's normal there.
fn sphere(centre: &Vector3<f64>, radius: f64, step: usize, rig: &StereoRig) -> Vec<(Vector3<f64>, [f64; 2])> {
    let mut seen = Vec::new();
    for v in (0..rig.height_px).step_by(step) {
        for u in (0..rig.width_px).step_by(step) {
            let (x, y) = rig.image_from_pixel(u as f64, v as f64);
            let ray = Vector3::new(x, y, rig.focal_px) / rig.focal_px;
            let (along, square) = (ray.dot(centre), ray.norm_squared());
            let root = along * along - square * (centre.norm_squared() - radius * radius);
            if root > 0.05 {
                let p = ray * ((along - root.sqrt()) / square);
                // The tangent plane n · P = distance has the same first derivatives.
                let n = (p - centre) / radius;
                let distance = n.dot(&p);
                let d = rig.disparity(p.z).unwrap();
                seen.push((Vector3::new(x, y, d), [n.x, n.y].map(|c| c * rig.baseline_m / distance)));
            }
        }
    }
    seen
}

#[test]
fn no_information_is_no_answer() {
    let (rig, mut rng) = (rig(), random(7));
    let mut rows = scattered_depth_rows(30, &phi(), &rig, &mut rng);
    rows.iter_mut().for_each(|row| row.sigma = f64::INFINITY);
    assert!(linear("wls", &rows).is_err());
    assert!(linear("irls", &rows).is_err());
    rows.iter_mut().for_each(|row| row.a = Vector6::zeros());
    assert_eq!(linear("ls", &rows).err(), Some(Unsolvable::Unobservable));
    assert_eq!(linear("lmeds", &rows).err(), Some(Unsolvable::Unobservable));
    rows[3].a[2] = f64::NAN;
    for name in LINEAR {
        assert!(linear(name, &rows).is_err(), "{name}");
    }
    for variance in [0.0, f64::INFINITY, f64::NAN] {
        let mut tracks = tracks(30, &phi(), &rig, &mut rng);
        for track in &mut tracks {
            track.before.cov = Matrix3::identity() * variance;
            track.after.cov = Matrix3::identity() * variance;
        }
        for kernel in [GAUSSIAN, StudentT::default()] {
            let found = maximum_likelihood(&tracks, &rig, &Twist::zero(), None, &kernel);
            assert!(found.is_err(), "variance {variance}: {found:?}");
        }
    }
    let mut behind = tracks(30, &phi(), &rig, &mut rng);
    behind.iter_mut().for_each(|track| track.before.mean.z = -1.0);
    assert!(maximum_likelihood(&behind, &rig, &Twist::zero(), None, &StudentT::default()).is_err());
}

#[test]
fn a_single_block_has_no_scatter_to_judge_by() {
    let (rig, mut rng) = (rig(), random(11));
    let whole = Blocks::tiling(&rig, 1000.0);
    assert_eq!(whole.count(), 1);
    let tracks = noisy_tracks(100, &phi(), &rig, &mut rng);
    let unknown = |found: &MotionEstimate| found.theta.cov.diagonal().iter().all(|v| v.is_infinite());
    let found = maximum_likelihood(&tracks, &rig, &phi(), Some(&whole), &GAUSSIAN).unwrap().motion;
    assert!(unknown(&found), "{found:?}");
    let pairs: Vec<PointPair> = tracks.iter().map(|t| PointPair::from_track(t, &rig, 0).unwrap()).collect();
    assert!(unknown(&align(&pairs, Form::Rigid, &Fitting::LeastSquares).unwrap()));
    let mut rows = scattered_depth_rows(50, &phi(), &rig, &mut rng);
    rows.iter_mut().for_each(|row| (row.block, row.b) = (0, row.b + 0.01 * normals::<1>(&mut rng)[0]));
    assert!(unknown(&linear("ls", &rows).unwrap().estimate(&rows)));
}

// ---- what does not belong ----

/// Replace the first `share` of the tracks' later ends by places anywhere in the image.
fn spoil(tracks: &mut [StereoTrack], share: f64, rng: &mut Pcg64Mcg) {
    let count = (share * tracks.len() as f64).round() as usize;
    let anywhere = places(count, rng);
    for (track, place) in tracks.iter_mut().zip(anywhere) {
        track.after.mean = place;
    }
}

#[test]
fn least_median_of_squares_withstands_forty_percent() {
    let (rig, truth, mut rng) = (rig(), phi(), random(8));
    for seed in 0..5 {
        let options = LmedsOptions { seed, ..LmedsOptions::default() };
        let mut rows = scattered_depth_rows(500, &truth, &rig, &mut rng);
        // What a row's own σ explains is no outlier.
        rows.iter_mut().for_each(|row| row.sigma = 0.01);
        for row in &mut rows[..200] {
            row.b += rng.random_range(0.05..0.5);
        }
        let fit = lmeds(&rows, Weighting::Unit, &options).unwrap();
        recovers(&fit.theta, &truth);
        assert_eq!(fit.inliers, 300);
        // Least squares does not.
        assert!((linear("ls", &rows).unwrap().theta - truth.vector()).amax() > 1e-3);

        let mut tracks = tracks(500, &truth, &rig, &mut rng);
        spoil(&mut tracks, 0.4, &mut rng);
        for form in [Form::Rigid, Form::Affine] {
            let found = align(&pairs(&tracks, &rig), form, &Fitting::Lmeds(options)).unwrap();
            recovers(&found.theta.mean, &truth);
        }
        let (mut dv, mut image) = flow_rows(&flows(500, &truth, &rig, &mut rng), &rig);
        dv[..200].iter_mut().for_each(|row| row.b += 0.1);
        image[..400].iter_mut().for_each(|row| row.b += rng.random_range(3.0..30.0));
        let two = two_step(&dv, &image, |rows| lmeds(rows, Weighting::Unit, &options)).unwrap();
        recovers(&two.theta.mean, &truth);
    }
}

/// Tracks with noise of σ 0.1 px in x and y and 0.15 px in d at both ends.
fn noisy_tracks(count: usize, phi: &Twist, rig: &StereoRig, rng: &mut Pcg64Mcg) -> Vec<StereoTrack> {
    let sigma = Vector3::new(0.1, 0.1, 0.15);
    let disturbed = |mean: Vector3<f64>, rng: &mut Pcg64Mcg| Gaussian {
        mean: mean + normals::<3>(rng).component_mul(&sigma),
        cov: Matrix3::from_diagonal(&sigma.map(|s| s * s)),
    };
    places(count, rng)
        .iter()
        .map(|xyd| StereoTrack {
            before: disturbed(*xyd, rng),
            after: disturbed(scattered::moved(xyd, phi, rig), rng),
        })
        .collect()
}

fn robust(tracks: &[StereoTrack], rig: &StereoRig) -> MotionEstimate {
    let options = MaximumLikelihoodOptions::default();
    let start = robust_start(tracks, rig, None, &options).unwrap();
    let blocks = Blocks::tiling(rig, 32.0);
    maximum_likelihood(tracks, rig, &start, Some(&blocks), &options.kernel).unwrap().motion
}

/// Mean NEES of `repeats` estimates over its degrees of freedom, and four standard errors of it.
fn consistency(repeats: usize, truth: &Twist, mut estimate: impl FnMut() -> MotionEstimate) -> (f64, f64) {
    let mut nees = egomotion::metrics::Nees::default();
    (0..repeats).for_each(|_| nees.add(&estimate().theta, &truth.vector()));
    assert_eq!(nees.refused, 0);
    (nees.per_degree().unwrap(), 4.0 * nees.standard_error().unwrap())
}

#[test]
fn maximum_likelihood_withstands_thirty_percent_of_mismatches() {
    let (rig, truth, mut rng) = (rig(), phi(), random(9));
    let (nees, four) = consistency(40, &truth, || {
        let mut tracks = noisy_tracks(500, &truth, &rig, &mut rng);
        spoil(&mut tracks, 0.3, &mut rng);
        let found = robust(&tracks, &rig);
        assert!(found.inliers >= 320 && found.inliers <= 400, "{}", found.inliers);
        found
    });
    println!("mismatches: NEES/6 {nees:.2} ± {four:.2}");
    // Mismatches all over pull to no side; the block-wise covariance accounts for what they add.
    assert!(nees < 1.0 + four, "{nees} {four}");
}

#[test]
fn maximum_likelihood_follows_the_scene_not_the_moving_body() {
    let (rig, truth, mut rng) = (rig(), phi(), random(10));
    // A fifth of the points moves alike, 0.2 m to the side and 0.1 m nearer.
    let body = Twist { t: truth.t + Vector3::new(0.2, 0.0, -0.1), omega: truth.omega };
    let (nees, four) = consistency(40, &truth, || {
        let mut tracks = noisy_tracks(400, &truth, &rig, &mut rng);
        tracks.extend(noisy_tracks(100, &body, &rig, &mut rng));
        robust(&tracks, &rig)
    });
    println!("moving body: NEES/6 {nees:.2} ± {four:.2}");
    assert!(nees < 1.0 + four, "{nees} {four}");
}
