//! Every printed covariance against the scatter it promises, over seeded repeats.
//!
//! The statistic is the mean NEES per degree of freedom, 1 for a true covariance, within four standard
//! errors √(2/degrees) of the mean. A covariance that is itself estimated from B blocks makes it Hotelling's T²
//! instead of χ²: its mean is at most (B − 1)/(B − 2 − p), which widens the upper bound (and the standard error).

use crate::scattered::{self, correlated, normals, phi, places, random, rig, stereo_flow};
use egomotion::constrain::{binocular_flow, dcce, image_flow};
use egomotion::estimate::alignment::{Fitting, Form, PointPair, align};
use egomotion::estimate::{
    Blocks, LmedsOptions, Row, StudentT, Weighting, least_squares, lmeds, m_estimate, maximum_likelihood,
    robust_scale, two_step,
};
use egomotion::geometry::{Gaussian, StereoRig, Twist, median};
use egomotion::metrics::{Coverage, Nees};
use egomotion::motion::{DepthVelocity, RigUncertainty, RigidPrediction, TimeToImpact, depth_velocity as vz};
use egomotion::observe::{DepthFlow, DepthTrack, StereoFlow, StereoTrack};
use nalgebra::{Matrix3, Vector2, Vector3, Vector6};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

const GAUSSIAN: StudentT = StudentT { nu: f64::INFINITY, fitted: false, iterations: 100, tolerance: 1e-6 };

/// Blocks of 32 px over 320×240: 10 × 8.
const BLOCKS: f64 = 80.0;

/// Mean NEES per degree of freedom over `repeats` estimates of φ.
fn nees(repeats: usize, truth: &Twist, mut estimate: impl FnMut() -> Gaussian<6>) -> Nees {
    let mut nees = Nees::default();
    (0..repeats).for_each(|_| nees.add(&estimate(), &truth.vector()));
    assert_eq!((nees.count, nees.refused), (repeats, 0));
    nees
}

#[track_caller]
fn is_chi_squared(name: &str, nees: &Nees) {
    let (mean, error) = (nees.per_degree().unwrap(), nees.standard_error().unwrap());
    println!("{name}: NEES/6 {mean:.3} ± {error:.3}");
    assert!((mean - 1.0).abs() < 4.0 * error, "{name}: {mean} ± {error}");
}

/// Within what a covariance from [`BLOCKS`] blocks may be.
#[track_caller]
fn is_hotelling(name: &str, nees: &Nees) {
    let (mean, error) = (nees.per_degree().unwrap(), nees.standard_error().unwrap());
    let inflated = (BLOCKS - 1.0) / (BLOCKS - 2.0 - 6.0);
    println!("{name}: NEES/6 {mean:.3} ± {error:.3}, with {BLOCKS} blocks 1 to {inflated:.3}");
    assert!(mean > 1.0 - 4.0 * error, "{name}: {mean} ± {error}");
    assert!(mean < inflated * (1.0 + 4.0 * error), "{name}: {mean} ± {error}");
}

fn blocks(rig: &StereoRig) -> Blocks {
    Blocks::tiling(rig, 32.0)
}

fn disturbed<const N: usize>(exact: &Gaussian<N>, rng: &mut Pcg64Mcg) -> Gaussian<N>
where
    nalgebra::Const<N>: nalgebra::DimSub<nalgebra::Const<1>>,
{
    let root = exact.cov.cholesky().unwrap().l();
    Gaussian { mean: exact.mean + root * normals::<N>(rng), cov: exact.cov }
}

// ---- maximum likelihood ----

/// Tracks with correlated noise of their own, about 0.1 px, at both ends.
fn noisy_tracks(count: usize, truth: &Twist, rig: &StereoRig, rng: &mut Pcg64Mcg) -> Vec<StereoTrack> {
    places(count, rng)
        .iter()
        .map(|xyd| {
            let ends = [*xyd, scattered::moved(xyd, truth, rig)];
            let [before, after] =
                ends.map(|mean| disturbed(&Gaussian { mean, cov: correlated(0.08, rng) }, rng));
            StereoTrack { before, after }
        })
        .collect()
}

fn noisy_flows(count: usize, truth: &Twist, rig: &StereoRig, rng: &mut Pcg64Mcg) -> Vec<StereoFlow> {
    places(count, rng)
        .iter()
        .map(|xyd| {
            let mut flow = stereo_flow(xyd, truth, rig, [1.0; 4]);
            flow.measured.cov = correlated(0.08, rng);
            flow.measured = disturbed(&flow.measured, rng);
            flow
        })
        .collect()
}

#[test]
fn maximum_likelihood_of_tracks() {
    let (rig, truth, mut rng) = (rig(), phi(), random(1));
    let blocks = blocks(&rig);
    let (mut model, mut robust) = (Nees::default(), Nees::default());
    let block_wise = nees(400, &truth, || {
        let tracks = noisy_tracks(400, &truth, &rig, &mut rng);
        let solve =
            |blocks, kernel| maximum_likelihood(&tracks, &rig, &truth, blocks, &kernel).unwrap().motion;
        model.add(&solve(None, GAUSSIAN).theta, &truth.vector());
        robust.add(&solve(Some(&blocks), StudentT::default()).theta, &truth.vector());
        solve(Some(&blocks), GAUSSIAN).theta
    });
    is_chi_squared("tracks, model", &model);
    is_hotelling("tracks, block-wise", &block_wise);
    is_hotelling("tracks, robust and block-wise", &robust);
}

#[test]
fn maximum_likelihood_of_flows() {
    let (rig, truth, mut rng) = (rig(), phi(), random(2));
    let blocks = blocks(&rig);
    let mut model = Nees::default();
    let block_wise = nees(400, &truth, || {
        let flows = noisy_flows(400, &truth, &rig, &mut rng);
        let solve = |blocks| maximum_likelihood(&flows, &rig, &truth, blocks, &GAUSSIAN).unwrap().motion;
        model.add(&solve(None).theta, &truth.vector());
        solve(Some(&blocks)).theta
    });
    is_chi_squared("flows, model", &model);
    is_hotelling("flows, block-wise", &block_wise);
}

/// Noise that is one and the same for all observations of a block: the model's covariance is far too small,
/// the block-wise one is honest.
#[test]
fn noise_shared_within_blocks() {
    let (rig, truth, mut rng) = (rig(), phi(), random(3));
    let blocks = blocks(&rig);
    let mut model = Nees::default();
    let block_wise = nees(400, &truth, || {
        let shared: Vec<Vector3<f64>> = (0..blocks.count()).map(|_| normals::<3>(&mut rng) * 0.1).collect();
        let tracks: Vec<StereoTrack> = places(800, &mut rng)
            .iter()
            .map(|xyd| {
                let mut track = scattered::track(xyd, &truth, &rig, Matrix3::identity() * 0.005);
                track.after.mean += shared[blocks.index(xyd.x, xyd.y)];
                track
            })
            .collect();
        let solve = |blocks| maximum_likelihood(&tracks, &rig, &truth, blocks, &GAUSSIAN).unwrap().motion;
        model.add(&solve(None).theta, &truth.vector());
        solve(Some(&blocks)).theta
    });
    is_hotelling("shared noise, block-wise", &block_wise);
    // Ten observations with one noise are worth one, though the model counts ten.
    let model = model.per_degree().unwrap();
    println!("shared noise, model: NEES/6 {model:.2}");
    assert!(model > 5.0 && model < 20.0, "{model}");
}

// ---- linear estimators, noise in the right-hand side alone ----

/// Rows of (11), (14) and (3) of exact places, their right-hand sides then disturbed by each row's σ.
struct Rows {
    depth: Vec<Row<6>>,
    binocular: Vec<Row<6>>,
    image: Vec<Row<6>>,
}

fn noisy_rows(
    count: usize,
    binocular_noise: f64,
    truth: &Twist,
    rig: &StereoRig,
    rng: &mut Pcg64Mcg,
) -> Rows {
    let (blocks, still) = (blocks(rig), Twist::zero());
    let mut rows = Rows { depth: Vec::new(), binocular: Vec::new(), image: Vec::new() };
    for xyd in places(count, rng) {
        let block = blocks.index(xyd.x, xyd.y);
        let add = |into: &mut Vec<Row<6>>, constraint, sigma: f64, rng: &mut Pcg64Mcg| {
            let row = Row::from_constraint(&constraint, block);
            into.push(Row { b: row.b + sigma * normals::<1>(rng)[0], sigma, ..row });
        };
        let slope = (normals::<2>(rng) * 0.1).into();
        let change =
            scattered::depth_flow(&xyd, slope, truth, rig).depth_change(rig.depth_disparity_product());
        let sigma = rng.random_range(0.5..1.5);
        add(&mut rows.depth, dcce::constraint(&change, rig.focal_px, &still), 0.01 * sigma, rng);
        let flow = stereo_flow(&xyd, truth, rig, [0.0, 0.01, 0.01, 0.01]);
        let printed = binocular_flow::constraint_as_printed(&flow, rig, &still);
        add(&mut rows.binocular, printed, binocular_noise * printed.sigma * sigma, rng);
        for constraint in image_flow::constraints(&flow, rig, &still) {
            add(&mut rows.image, constraint, constraint.sigma * sigma, rng);
        }
    }
    rows
}

#[test]
fn linear_estimators() {
    let (rig, truth, mut rng) = (rig(), phi(), random(4));
    let start: Vector6<f64> = truth.vector();
    let names = ["ls", "weighted ls", "irls", "joint", "two steps", "two steps irls"];
    let mut all = names.map(|_| Nees::default());
    for _ in 0..400 {
        // With a first step of which the second hardly notices the error.
        let rows = noisy_rows(600, 0.1, &truth, &rig, &mut rng);
        let joint: Vec<Row<6>> = rows.binocular.iter().chain(&rows.image).copied().collect();
        let irls = |rows: &[Row<3>]| m_estimate(rows, &Vector3::zeros(), &StudentT::default());
        let estimates = [
            least_squares(&rows.depth, Weighting::Unit).unwrap().estimate(&rows.depth),
            least_squares(&rows.depth, Weighting::InverseVariance).unwrap().estimate(&rows.depth),
            m_estimate(&rows.depth, &start, &StudentT::default()).unwrap().estimate(&rows.depth),
            least_squares(&joint, Weighting::InverseVariance).unwrap().estimate(&joint),
            two_step(&rows.binocular, &rows.image, |r| least_squares(r, Weighting::Unit)).unwrap(),
            two_step(&rows.binocular, &rows.image, irls).unwrap(),
        ];
        for (nees, estimate) in all.iter_mut().zip(estimates) {
            nees.add(&estimate.theta, &truth.vector());
        }
    }
    for (name, nees) in names.iter().zip(&all) {
        is_hotelling(name, nees);
    }
}

/// With noise as it is, the first step's error also stands in the second's residuals, as a pattern over the whole
/// image, and is counted as scatter of the blocks: the covariance is too large, never too small.
#[test]
fn two_steps_are_not_overconfident() {
    let (rig, truth, mut rng) = (rig(), phi(), random(10));
    for robust in [false, true] {
        let nees = nees(400, &truth, || {
            let rows = noisy_rows(600, 1.0, &truth, &rig, &mut rng);
            let solve = |rows: &[Row<3>]| match robust {
                true => m_estimate(rows, &Vector3::zeros(), &StudentT::default()),
                false => least_squares(rows, Weighting::Unit),
            };
            two_step(&rows.binocular, &rows.image, solve).unwrap().theta
        });
        let (mean, error) = (nees.per_degree().unwrap(), nees.standard_error().unwrap());
        println!("two steps of equal noise, robust {robust}: NEES/6 {mean:.3} ± {error:.3}");
        assert!(mean > 0.5 && mean < 1.0 + 4.0 * error, "{robust} {mean} ± {error}");
    }
}

#[test]
fn alignments() {
    let (rig, truth, mut rng) = (rig(), phi(), random(5));
    let (blocks, motion) = (blocks(&rig), truth.exp());
    let names = ["rigid", "linear22", "rigid irls", "linear22 irls"];
    let mut all = names.map(|_| Nees::default());
    for _ in 0..400 {
        let pairs: Vec<PointPair> = places(600, &mut rng)
            .iter()
            .map(|xyd| {
                let before = rig.point(xyd).unwrap();
                // The further the noisier, and most along the ray, as stereo has it; before the motion exact.
                let sigma = Vector3::new(0.001, 0.001, 0.003) * before.z;
                let after = motion.apply(&before) + normals::<3>(&mut rng).component_mul(&sigma);
                let variance = sigma.norm_squared() / 3.0;
                PointPair { before, after, variance, block: blocks.index(xyd.x, xyd.y) }
            })
            .collect();
        let robust = Fitting::MEstimator(StudentT::default());
        let estimates = [
            align(&pairs, Form::Rigid, &Fitting::LeastSquares),
            align(&pairs, Form::Affine, &Fitting::LeastSquares),
            align(&pairs, Form::Rigid, &robust),
            align(&pairs, Form::Affine, &robust),
        ];
        for (nees, estimate) in all.iter_mut().zip(estimates) {
            nees.add(&estimate.unwrap().theta, &truth.vector());
        }
    }
    for (name, nees) in names.iter().zip(&all) {
        is_hotelling(name, nees);
    }
}

#[test]
fn scale_of_least_median_of_squares() {
    let (mut rng, sigma, rows) = (random(6), 0.3, 2001);
    // At the true θ: the scale from the median is asymptotically σ N(1, 1.361/n), times 1 + 5/(n − p).
    let repeats = 200;
    let scales = (0..repeats).map(|_| {
        let mut squares: Vec<f64> = (0..rows).map(|_| (sigma * normals::<1>(&mut rng)[0]).powi(2)).collect();
        robust_scale(median(&mut squares), rows, 3) / (sigma * (1.0 + 5.0 / (rows - 3) as f64))
    });
    let mean = scales.sum::<f64>() / f64::from(repeats);
    let error = (1.361 / rows as f64 / f64::from(repeats)).sqrt();
    println!("scale from the median: {mean:.4} ± {error:.4} σ");
    assert!((mean - 1.0).abs() < 4.0 * error, "{mean} ± {error}");

    // Of the whole: with a share ε of far outliers the median of all is the ½/(1 − ε) quantile of the good ones.
    // The best of m subsets of three is off by a share of σ, which the refits make good, however few there were.
    for (outliers, inflation) in [(0.0, 1.0), (0.2, 1.318), (0.4, 2.051)] {
        let truth = Vector3::new(0.5, -1.0, 2.0);
        let (mut sums, repeats) = ([0.0; 2], 20);
        for seed in 0..repeats {
            let rows: Vec<Row<3>> = (0..rows)
                .map(|block| {
                    let (a, noise) = (normals::<3>(&mut rng), sigma * normals::<1>(&mut rng)[0]);
                    let far = if rng.random_bool(outliers) { rng.random_range(20.0..90.0) } else { 0.0 };
                    Row { a, b: a.dot(&truth) + noise + far, sigma, block }
                })
                .collect();
            for (sum, confidence) in sums.iter_mut().zip([0.99, 1.0 - 1e-15]) {
                let options = LmedsOptions { seed, confidence, ..LmedsOptions::default() };
                *sum += lmeds(&rows, Weighting::Unit, &options).unwrap().residual_scale / sigma;
            }
        }
        let [few, many] = sums.map(|sum| sum / repeats as f64 / inflation);
        println!(
            "scale of the search with {outliers} outliers: {few:.3}, of more subsets {many:.3} of the truth's"
        );
        assert!(few > 0.97 && few < 1.05, "{outliers}: {few}");
        assert!((many - few).abs() < 0.01, "{outliers}: {few} {many}");
    }
}

// ---- depth velocity and time to impact ----

/// Variance of `draw` over many draws against what was promised; its standard error is √(2/n).
#[track_caller]
fn is_variance(name: &str, promised: f64, mut draw: impl FnMut() -> f64) {
    let draws: u32 = 20_000;
    let (sum, squares) = (0..draws).map(|_| draw()).fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
    let n = f64::from(draws);
    let ratio = (squares / n - (sum / n).powi(2)) / promised;
    let error = (2.0 / n).sqrt();
    println!("{name}: {ratio:.3} ± {error:.3} of the promised variance");
    assert!((ratio - 1.0).abs() < 4.0 * error, "{name}: {ratio} ± {error}");
}

/// (39c), (44), (47c) and (50), with noise so small (0.02 px of 15) that the formulas' linearisation is exact to 10⁻⁵.
#[test]
fn variances_of_depth_velocity() {
    let (bf, mut rng) = (rig().depth_disparity_product(), random(7));
    let small = |variances: [f64; 4]| variances.map(|v: f64| v * 4e-4);
    for slope in [0.0, 0.3] {
        let exact = DepthFlow {
            x_px: 0.0,
            y_px: 0.0,
            disparity: Gaussian::independent([15.0, slope, -slope, 0.8], small([1.0, 0.5, 0.5, 0.5])),
            flow: Gaussian::independent([2.0, -1.5], [4e-4; 2]),
        };
        is_variance("(39c)", vz::dcce(&exact.depth_change(bf)).vz().variance(), || {
            let disparity = disturbed(&exact.disparity, &mut rng);
            let flow = disturbed(&exact.flow, &mut rng);
            vz::dcce(&DepthFlow { disparity, flow, ..exact }.depth_change(bf)).vz().value()
        });
        let exact = DepthTrack {
            x_px: 0.0,
            y_px: 0.0,
            disparity: Gaussian::independent([15.0, 16.0, slope, -slope], small([1.0, 1.5, 0.5, 0.5])),
            displacement: Gaussian::independent([2.0, -1.5], [8e-4; 2]),
        };
        is_variance("(47c)", vz::dcce(&exact.depth_change(bf)).vz().variance(), || {
            let disparity = disturbed(&exact.disparity, &mut rng);
            let displacement = disturbed(&exact.displacement, &mut rng);
            vz::dcce(&DepthTrack { disparity, displacement, ..exact }.depth_change(bf)).vz().value()
        });
    }
    let exact = StereoFlow {
        x_px: 0.0,
        y_px: 0.0,
        measured: Gaussian::independent([15.0, 2.0, 0.5, 1.1], small([1.0, 0.7, 1.0, 1.4])),
    };
    is_variance("(44)", vz::dv(&exact, bf).vz().variance(), || {
        let measured = disturbed(&exact.measured, &mut rng);
        vz::dv(&StereoFlow { measured, ..exact }, bf).vz().value()
    });
    let end = |d: f64| Gaussian::independent([3.0, 4.0, d], [4e-4; 3]);
    let exact = StereoTrack { before: end(15.0), after: end(16.0) };
    is_variance("(50)", vz::dv_discrete(&exact, bf).vz().variance(), || {
        let (before, after) = (disturbed(&exact.before, &mut rng), disturbed(&exact.after, &mut rng));
        vz::dv_discrete(&StereoTrack { before, after }, bf).vz().value()
    });
}

/// 95 % intervals hold the truth in 95 of 100 draws, wherever looming lies; a truth that recedes never impacts.
#[test]
fn intervals_of_time_to_impact() {
    let (bf, dt, mut rng) = (rig().depth_disparity_product(), 0.1, random(8));
    for (name, later) in [("approaching", 15.9), ("barely", 15.2), ("still", 15.0), ("receding", 14.7)] {
        let exact = Gaussian::independent([15.0, later], [0.01, 0.0144]);
        // d′/d − 1 is not quite normal: at 0.1 px of 15 the tails differ by about 10⁻⁴.
        let truth = (later - 15.0) / (15.0 * dt);
        let truth_s = if truth > 0.0 { truth.recip() } else { f64::INFINITY };
        let mut coverage = Coverage::default();
        let draws = 20_000;
        for _ in 0..draws {
            let looming =
                DepthVelocity::from_disparities(&disturbed(&exact, &mut rng), bf).looming(dt).unwrap();
            // Nothing within the interval's reach: it says that there is no impact.
            let (lo, hi) = TimeToImpact { looming }.interval95_s().unwrap_or((f64::INFINITY, f64::INFINITY));
            coverage.add(lo, hi, truth_s);
        }
        let share = coverage.share().unwrap();
        println!("impact, {name}: {:.2} % of the intervals hold the truth", 100.0 * share);
        let error = (0.95 * 0.05 / f64::from(draws)).sqrt();
        match name {
            // One-sided: what recedes has no impact, and only a near end above zero denies that.
            "still" => assert!((share - 0.975).abs() < 4.0 * error, "{share}"),
            "receding" => assert!(share > 0.975 - 4.0 * error, "{share}"),
            _ => assert!((share - 0.95).abs() < 4.0 * error, "{name} {share}"),
        }
    }
}

/// The rigid scene's depth velocity with φ and d both uncertain.
#[test]
fn rigid_depth_velocity() {
    let (rig, truth, mut rng) = (rig(), phi(), random(9));
    let motion = Gaussian { mean: truth.vector(), cov: correlated::<6>(0.0005, &mut rng) };
    let mut nees = Nees::default();
    for xyd in places(2000, &mut rng) {
        let sigma = 0.02;
        let drawn = disturbed(&motion, &mut rng);
        let measured = Vector3::new(xyd.x, xyd.y, xyd.z + sigma * normals::<1>(&mut rng)[0]);
        let prediction = RigidPrediction::new(&drawn, &RigUncertainty::none(), &rig).unwrap();
        let got = prediction.depth_velocity(&measured, sigma).unwrap().z_vz;
        let p = rig.point(&xyd).unwrap();
        nees.add(&got, &Vector2::new(p.z, truth.exp().apply(&p).z - p.z));
    }
    let (mean, error) = (nees.per_degree().unwrap(), nees.standard_error().unwrap());
    println!("rigid VZ: NEES/2 {mean:.3} ± {error:.3}");
    assert!((mean - 1.0).abs() < 4.0 * error, "{mean} ± {error}");
}
