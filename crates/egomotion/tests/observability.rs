//! What cannot be observed is said in words: the motions that geometry hides, and no others.

use crate::scattered::{self, normals, phi, places, plane, random, rig, stereo_flow, track};
use egomotion::constrain::{binocular_flow, dcce, image_flow};
use egomotion::estimate::{
    Blocks, MotionEstimate, Row, StudentT, Unsolvable, Weighting, errors_in_variables, least_squares,
    maximum_likelihood, two_step,
};
use egomotion::geometry::{Gaussian, StereoRig, Twist};
use egomotion::observe::{DepthChange, DepthFlow};
use nalgebra::{Matrix3, Vector3};

type Seen = Vec<(Vector3<f64>, [f64; 2])>;

const GAUSSIAN: StudentT = StudentT { nu: f64::INFINITY, iterations: 100, tolerance: 1e-9, fitted: false };

/// φ from depth changes by least squares.
fn dcce_of(seen: &Seen, truth: &Twist, rig: &StereoRig) -> Result<MotionEstimate, Unsolvable> {
    let rows: Vec<Row<6>> = seen
        .iter()
        .enumerate()
        .map(|(block, (xyd, slope))| {
            let flow = scattered::depth_flow(xyd, *slope, truth, rig);
            let change = flow.depth_change(rig.depth_disparity_product());
            Row::from_constraint(&dcce::constraint(&change, rig.focal_px, truth), block)
        })
        .collect();
    Ok(least_squares(&rows, Weighting::Unit)?.estimate(&rows))
}

/// φ from binocular flow, in two steps.
fn dv_of(places: &[Vector3<f64>], truth: &Twist, rig: &StereoRig) -> Result<MotionEstimate, Unsolvable> {
    let (mut dv, mut image) = (Vec::new(), Vec::new());
    for (block, xyd) in places.iter().enumerate() {
        let flow = stereo_flow(xyd, truth, rig, [0.01, 0.02, 0.02, 0.02]);
        let row = binocular_flow::constraint_as_printed(&flow, rig, truth);
        dv.push(Row::from_constraint(&row, block));
        image.extend(image_flow::constraints(&flow, rig, truth).map(|c| Row::from_constraint(&c, block)));
    }
    two_step(&dv, &image, |rows| least_squares(rows, Weighting::Unit))
}

/// φ by maximum likelihood.
fn ml_of(places: &[Vector3<f64>], truth: &Twist, rig: &StereoRig) -> Result<MotionEstimate, Unsolvable> {
    let tracks: Vec<_> = places.iter().map(|p| track(p, truth, rig, Matrix3::identity() * 0.01)).collect();
    Ok(maximum_likelihood(&tracks, rig, &Twist::zero(), None, &GAUSSIAN)?.motion)
}

fn words(found: &Result<MotionEstimate, Unsolvable>) -> String {
    found.as_ref().map_or_else(ToString::to_string, |found| found.undetermined.to_string())
}

fn together(parts: &[&Seen]) -> Seen {
    parts.iter().flat_map(|part| part.iter().copied()).collect()
}

#[test]
fn planes_by_depth_change() {
    let rig = rig();
    let wall = plane(&Vector3::z(), 3.0, 16, &rig);
    let far = plane(&Vector3::z(), 4.0, 16, &rig);
    let ground = plane(&Vector3::y(), 0.9, 16, &rig);
    let side = plane(&Vector3::x(), 1.0, 16, &rig);
    let slanted = plane(&Vector3::new(0.6, 0.0, 0.8), 2.5, 16, &rig);
    for (name, seen, expected) in [
        ("wall", wall.clone(), "shift along x; shift along y; turn about z"),
        (
            "a single depth, in two patches",
            together(&[&wall, &far]),
            "shift along x; shift along y; turn about z",
        ),
        ("ground", ground.clone(), "shift along x; shift along z; turn about y"),
        ("slanted", slanted.clone(), "shift along (0.8, 0, -0.6); shift along y; turn about (0.6, 0, 0.8)"),
        ("ground and wall", together(&[&ground, &wall]), "shift along x"),
        ("wall and slanted", together(&[&wall, &slanted]), "shift along y"),
        ("a corner of three", together(&[&ground, &wall, &side]), ""),
    ] {
        // At rest, turning alone, and with all six: what is hidden is a matter of geometry.
        let turning = Twist { t: Vector3::zeros(), ..phi() };
        for truth in [Twist::zero(), turning, phi()] {
            let found = dcce_of(&seen, &truth, &rig);
            assert_eq!(words(&found), expected, "{name} {truth:?}");
            let found = found.unwrap();
            assert_eq!(found.is_complete(), expected.is_empty(), "{name}");
            assert_eq!(found.observed.iter().all(|o| *o), found.undetermined.count() == 0, "{name}");
        }
    }
}

#[test]
fn scenes_by_binocular_flow_and_maximum_likelihood() {
    let (rig, mut rng) = (rig(), random(41));
    let of = |seen: &Seen| seen.iter().map(|(xyd, _)| *xyd).collect::<Vec<_>>();
    let wall = of(&plane(&Vector3::z(), 3.0, 24, &rig));
    let ground = of(&plane(&Vector3::y(), 0.9, 16, &rig));
    let turning = Twist { t: Vector3::zeros(), ..phi() };
    for truth in [Twist::zero(), turning, phi()] {
        // Points tell all but on a line, whatever their plane and depth.
        for places in [&wall, &ground, &places(100, &mut rng)] {
            assert_eq!(words(&ml_of(places, &truth, &rig)), "");
        }
        assert_eq!(words(&dv_of(&wall, &truth, &rig)), "");
        // VZ = tZ + ΩX Y − ΩY X with the same Y everywhere; the second step stands on what the first did not find.
        let level = dv_of(&ground, &truth, &rig);
        assert_eq!(
            words(&level),
            "shift along x; shift along y; turn about x through (0, 0.9, 0) m; turn about z"
        );
        assert_eq!(level.unwrap().observed, [false, false, false, false, true, false]);
    }
}

#[test]
fn lines_and_points_by_maximum_likelihood() {
    let rig = rig();
    let line: Vec<Vector3<f64>> =
        (0..60).map(|i| rig.project(&Vector3::new(0.3, -0.4 + 0.01 * f64::from(i), 2.0)).unwrap()).collect();
    let still = ml_of(&line, &Twist::zero(), &rig);
    assert_eq!(words(&still), "turn about y through (0.3, 0, 2) m");
    let beside = still.unwrap().seen_from(&Vector3::new(0.05, 0.0, 0.0));
    assert_eq!(beside.undetermined.to_string(), "turn about y through (0.25, 0, 2) m");
    // A single point, many times: what turns about it.
    let point = [rig.project(&Vector3::new(0.3, -0.4, 2.0)).unwrap(); 20];
    let about = "turn about x through (0, -0.4, 2) m; turn about y through (0.3, 0, 2) m; \
                 turn about z through (0.3, -0.4, 0) m";
    assert_eq!(words(&ml_of(&point, &Twist::zero(), &rig)), about);
    // In motion the axis lies between where the line was and where it goes.
    assert_eq!(ml_of(&line, &phi(), &rig).unwrap().undetermined.count(), 1);
    assert_eq!(ml_of(&point, &phi(), &rig).unwrap().undetermined.count(), 3);
}

#[test]
fn too_few_points() {
    let (rig, mut rng) = (rig(), random(42));
    let few = places(2, &mut rng);
    assert_eq!(ml_of(&few, &phi(), &rig).err(), Some(Unsolvable::FewRows { rows: 2, needed: 3 }));
    assert!(matches!(dv_of(&few, &phi(), &rig), Err(Unsolvable::FewRows { .. })));
    let seen: Seen = places(5, &mut rng).into_iter().map(|p| (p, normals::<2>(&mut rng).into())).collect();
    assert_eq!(dcce_of(&seen, &phi(), &rig).err(), Some(Unsolvable::FewRows { rows: 5, needed: 6 }));
    let none = errors_in_variables(&[], &rig, &phi(), &Blocks::tiling(&rig, 16.0));
    assert_eq!(none.err(), Some(Unsolvable::FewRows { rows: 0, needed: 6 }));
}

// ---- with noise in the regressors ----

/// Depth changes of planes, every pixel of the image, with noise of its own in each pixel of three maps of disparity.
fn noisy_changes(
    normals_at: &[(Vector3<f64>, f64)],
    truth: &Twist,
    seed: u64,
    rig: &StereoRig,
) -> Vec<DepthChange> {
    let mut rng = random(seed);
    let sigma = 0.01;
    let (width, height) = (rig.width_px, rig.height_px);
    let mut map = || (0..width * height).map(|_| sigma * normals::<1>(&mut rng)[0]).collect::<Vec<f64>>();
    let (now, change) = (map(), map());
    let mut changes = Vec::new();
    for v in 1..height - 1 {
        for u in 1..width - 1 {
            let (x, y) = rig.image_from_pixel(u as f64, v as f64);
            // The nearest of the planes.
            let nearest = normals_at.iter().map(|(n, distance)| {
                let slope = [n.x, n.y].map(|c| c * rig.baseline_m / distance);
                (slope[0] * x + slope[1] * y + n.z * rig.focal_px * rig.baseline_m / distance, slope)
            });
            let Some((d, slope)) = nearest.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(d, _)| *d > 5.0)
            else {
                continue;
            };
            let exact = scattered::depth_flow(&Vector3::new(x, y, d), slope, truth, rig);
            let i = v * width + u;
            let noise = [
                now[i],
                0.5 * (now[i + 1] - now[i - 1]),
                0.5 * (now[i + width] - now[i - width]),
                change[i] * 0.5f64.sqrt(),
            ];
            let (var, half) = (sigma * sigma, 0.5 * sigma * sigma);
            let noisy = DepthFlow {
                disparity: Gaussian {
                    mean: exact.disparity.mean + nalgebra::Vector4::from(noise),
                    ..Gaussian::independent([0.0; 4], [var, half, half, half])
                },
                ..exact
            };
            changes.push(noisy.depth_change(rig.depth_disparity_product()));
        }
    }
    changes
}

#[test]
fn noise_does_not_make_a_plane_tell_more() {
    let (rig, truth) = (rig(), phi());
    let (wall, ground, side) = ((Vector3::z(), 6.0), (Vector3::y(), 0.9), (Vector3::x(), 1.0));
    for (name, planes, count, observed) in [
        ("wall", vec![wall], 3, [false, false, true, true, true, false]),
        ("ground", vec![ground], 3, [false, true, false, true, false, true]),
        ("ground and wall", vec![ground, wall], 1, [false, true, true, true, true, true]),
        ("corner", vec![ground, wall, side], 0, [true; 6]),
    ] {
        for seed in 0..4 {
            let changes = noisy_changes(&planes, &truth, seed, &rig);
            let blocks = Blocks::tiling(&rig, 16.0);
            // Least squares thinks that it sees everything.
            let rows: Vec<Row<6>> = changes
                .iter()
                .map(|c| {
                    Row::from_constraint(
                        &dcce::constraint(c, rig.focal_px, &truth),
                        blocks.index(c.x_px, c.y_px),
                    )
                })
                .collect();
            assert_eq!(least_squares(&rows, Weighting::Unit).unwrap().observability.rank(), 6);
            let found = errors_in_variables(&changes, &rig, &truth, &blocks).unwrap();
            println!("{name} {seed}: {} {:?}", found.undetermined, found.observed);
            assert_eq!(found.undetermined.count(), count, "{name} {seed}: {}", found.undetermined);
            assert_eq!(found.observed, observed, "{name} {seed}");
            for i in (0..6).filter(|&i| observed[i]) {
                let (error, sigma) =
                    (found.theta.mean[i] - truth.vector()[i], found.theta.cov[(i, i)].sqrt());
                assert!(error.abs() < 5.0 * sigma, "{name} {seed}: {i} off by {error} of {sigma}");
            }
        }
    }
}
