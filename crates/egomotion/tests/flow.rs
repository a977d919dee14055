//! Dense flow on synthetic images whose motion is known exactly.

use egomotion::geometry::{Field, Grid, Image};
use egomotion::observe::Pyramid;
use egomotion::observe::flow::{FlowError, FlowField, FlowOptions, GUESS_SIGMA_PX, dense_flow};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

const SIZE: (usize, usize) = (160, 120);

/// Band-limited texture: plane waves of random direction and phase, 5 … 60 pixels long, about 30 grey
/// levels strong. Known at every real coordinate, so that a warped image needs no interpolation.
struct Texture(Vec<[f64; 4]>);

impl Texture {
    fn new(seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let wave = |_| {
            let length = 5.0 * 12.0_f64.powf(random.random());
            let angle = std::f64::consts::TAU * random.random::<f64>();
            let k = std::f64::consts::TAU / length;
            [k * angle.cos(), k * angle.sin(), std::f64::consts::TAU * random.random::<f64>(), 7.0]
        };
        Self((0..40).map(wave).collect())
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        128.0 + self.0.iter().map(|[kx, ky, phase, a]| a * (kx * x + ky * y + phase).sin()).sum::<f64>()
    }
}

/// x′ = centre + (1 + zoom) R(angle) (x − centre) + shift, in pixels.
#[derive(Clone, Copy)]
struct Motion {
    shift: [f64; 2],
    angle: f64,
    zoom: f64,
}

impl Motion {
    const fn shift(u: f64, v: f64) -> Self {
        Self { shift: [u, v], angle: 0.0, zoom: 0.0 }
    }

    fn turn(self, x: f64, y: f64) -> [f64; 2] {
        let (s, c) = self.angle.sin_cos();
        [(1.0 + self.zoom) * (c * x - s * y), (1.0 + self.zoom) * (s * x + c * y)]
    }

    fn displacement(self, x: f64, y: f64) -> [f64; 2] {
        let centred = [x - SIZE.0 as f64 / 2.0, y - SIZE.1 as f64 / 2.0];
        let turned = self.turn(centred[0], centred[1]);
        [0, 1].map(|i| turned[i] + self.shift[i] - centred[i])
    }

    /// Where a pixel of the second image comes from.
    fn inverse(self, x: f64, y: f64) -> [f64; 2] {
        let centre = [SIZE.0 as f64 / 2.0, SIZE.1 as f64 / 2.0];
        let back = Self { shift: [0.0; 2], angle: -self.angle, zoom: 1.0 / (1.0 + self.zoom) - 1.0 };
        let p = back.turn(x - self.shift[0] - centre[0], y - self.shift[1] - centre[1]);
        [p[0] + centre[0], p[1] + centre[1]]
    }
}

/// Both images: noise of the given σ in each, and `offset` grey levels added to the second.
fn images(seed: u64, motion: Motion, noise: f64, offset: f64) -> [Image; 2] {
    let texture = Texture::new(seed);
    let mut random = Pcg64Mcg::seed_from_u64(seed + 1);
    let normal = Normal::new(0.0, noise.max(1e-9)).unwrap();
    let mut image = |grey: &dyn Fn(f64, f64) -> f64| {
        Grid::from_fn(SIZE.0, SIZE.1, |u, v| (grey(u as f64, v as f64) + normal.sample(&mut random)) as f32)
    };
    [
        image(&|x, y| texture.at(x, y)),
        image(&|x, y| {
            let [x, y] = motion.inverse(x, y);
            texture.at(x, y) + offset
        }),
    ]
}

fn flow_of([a, b]: [Image; 2], initial: Option<&FlowField>) -> FlowField {
    dense_flow(&Pyramid::new(a, 6), &Pyramid::new(b, 6), initial, &FlowOptions::default()).unwrap()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Share of answered pixels, median endpoint error (px), and the robust standard deviations of the two
/// components' errors divided by σ.
fn judge(flow: &FlowField, motion: Motion) -> (f64, f64, [f64; 2]) {
    let (mut errors, mut scores) = (vec![], [vec![], vec![]]);
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let Some(answer) = flow.get(x, y) else { continue };
            let truth = motion.displacement(x as f64, y as f64);
            let error = [answer.mean[0] - truth[0], answer.mean[1] - truth[1]];
            errors.push(error[0].hypot(error[1]));
            for i in 0..2 {
                scores[i].push((error[i] / answer.sigma(i)).abs());
            }
        }
    }
    let density = errors.len() as f64 / (SIZE.0 * SIZE.1) as f64;
    let result = (density, median(errors), scores.map(|s| 1.4826 * median(s)));
    println!("density {:.3}, median error {:.4} px, error/σ {:.2?}", result.0, result.1, result.2);
    result
}

const ROTATION_AND_ZOOM: Motion = Motion { shift: [1.3, -0.7], angle: 0.03, zoom: 0.04 };

#[test]
fn noise_free_motion_is_found_to_a_twentieth_of_a_pixel() {
    for motion in [Motion::shift(0.5, -0.25), Motion::shift(-3.3, 2.6), ROTATION_AND_ZOOM] {
        let (density, error, _) = judge(&flow_of(images(1, motion, 0.0, 0.0), None), motion);
        assert!(density > 0.8 && error <= 0.05);
    }
}

#[test]
fn noise_costs_little_and_the_covariance_says_how_much() {
    for motion in [Motion::shift(0.5, -0.25), Motion::shift(-3.3, 2.6), ROTATION_AND_ZOOM] {
        for noise in [2.0, 4.0, 8.0] {
            let (density, error, scores) = judge(&flow_of(images(2, motion, noise, 0.0), None), motion);
            assert!(density > 0.8 && error <= 0.05 * noise);
            assert!(scores.iter().all(|s| (0.7..=1.4).contains(s)), "{scores:?}");
        }
    }
}

#[test]
fn the_covariance_notices_noise_that_neighbours_share() {
    let motion = Motion::shift(-3.3, 2.6);
    let mut pair = images(7, motion, 0.0, 0.0);
    let mut random = Pcg64Mcg::seed_from_u64(8);
    let normal = Normal::new(0.0, 8.0).unwrap();
    for image in &mut pair {
        let white: Image = Grid::from_fn(SIZE.0 + 2, SIZE.1 + 2, |_, _| normal.sample(&mut random) as f32);
        for v in 0..SIZE.1 {
            for u in 0..SIZE.0 {
                let at =
                    |i: usize, j: usize| [1.0, 2.0, 1.0][i] * [1.0, 2.0, 1.0][j] * white.at(u + i, v + j);
                let noise: f32 = (0..9).map(|k| at(k % 3, k / 3)).sum::<f32>() / 16.0;
                image.set(u, v, image.at(u, v) + noise);
            }
        }
    }
    let (density, _, scores) = judge(&flow_of(pair, None), motion);
    assert!(density > 0.8 && scores.iter().all(|s| (0.7..=1.4).contains(s)), "{scores:?}");
}

#[test]
fn large_displacement_is_found() {
    let motion = Motion::shift(25.0, -6.4);
    let (density, error, _) = judge(&flow_of(images(3, motion, 2.0, 0.0), None), motion);
    assert!(density > 0.6 && error <= 0.1);
}

#[test]
fn a_brightness_offset_does_no_harm() {
    let motion = Motion::shift(2.4, 1.2);
    let (_, plain, _) = judge(&flow_of(images(4, motion, 2.0, 0.0), None), motion);
    let (density, error, _) = judge(&flow_of(images(4, motion, 2.0, 5.0), None), motion);
    assert!(density > 0.8 && error <= 1.02 * plain, "{error} against {plain} px");
}

#[test]
fn a_prediction_finds_what_is_out_of_reach_and_a_wrong_one_does_no_harm() {
    let motion = Motion::shift(60.0, 9.5);
    let prediction = |u: f32, v: f32| {
        let plane = |value| Field::from_grid(Grid::filled(SIZE.0, SIZE.1, value));
        FlowField::prediction(plane(u), plane(v))
    };
    let right = prediction(59.3, 10.0);
    let (density, error, _) = judge(&flow_of(images(5, motion, 2.0, 0.0), Some(&right)), motion);
    assert!(density > 0.4 && error <= 0.1);

    let motion = Motion::shift(-3.3, 2.6);
    let (density, error, _) =
        judge(&flow_of(images(5, motion, 2.0, 0.0), Some(&prediction(20.0, 4.0))), motion);
    assert!(density > 0.8 && error <= 0.1);
}

#[test]
fn threads_do_not_change_the_answer() {
    let pair = images(6, ROTATION_AND_ZOOM, 2.0, 0.0);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let flow = pool.install(|| flow_of(pair.clone(), None));
        [flow.u.grid(), flow.v.grid(), &flow.cov_uu, &flow.cov_uv, &flow.cov_vv]
            .map(|plane| plane.values().iter().map(|x| x.to_bits()).collect::<Vec<_>>())
    };
    assert_eq!(with(1), with(2));
}

#[test]
fn without_texture_or_with_one_direction_of_it_nothing_is_answered() {
    let flat = || Grid::filled(64, 48, 99.0);
    assert_eq!(flow_of([flat(), flat()], None).u.count(), 0);
    let stripes =
        |shift: f64| Grid::from_fn(64, 48, |u, _| (100.0 + 40.0 * ((u as f64 - shift) * 0.7).sin()) as f32);
    assert_eq!(flow_of([stripes(0.0), stripes(0.4)], None).u.count(), 0);
    let noise = |seed| {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let normal = Normal::new(100.0, 2.0).unwrap();
        Grid::from_fn(64, 48, |_, _| normal.sample(&mut random) as f32)
    };
    assert!(flow_of([noise(1), noise(2)], None).u.density() < 0.02);
}

#[test]
fn small_and_strange_images_are_no_trouble() {
    for (width, height) in [(1, 1), (1, 40), (7, 9), (8, 8), (33, 9), (9, 64)] {
        let image = || Grid::from_fn(width, height, |u, v| ((u * 31 + v * 17) % 23) as f32 * 9.0);
        let flow = flow_of([image(), image()], None);
        assert_eq!(flow.size(), (width, height));
        if width.min(height) < 8 {
            assert_eq!(flow.u.count(), 0);
        }
    }
    for bad in [f32::NAN, f32::INFINITY, -1e30] {
        let strange = Grid::from_fn(40, 30, |u, v| if (u / 9 + v) % 3 == 0 { bad } else { u as f32 });
        assert_eq!(flow_of([strange.clone(), strange], None).size(), (40, 30));
    }
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let pyramid = |width| Pyramid::new(Grid::filled(width, 20, 0.0), 3);
    let options = FlowOptions::default();
    let mismatch = Err(FlowError::SizeMismatch { from: (30, 20), to: (31, 20) });
    assert_eq!(dense_flow(&pyramid(30), &pyramid(31), None, &options), mismatch);
    let prediction = FlowField::missing(31, 20);
    assert_eq!(dense_flow(&pyramid(30), &pyramid(30), Some(&prediction), &options), mismatch);
    let options = FlowOptions { window_radius_px: 0, ..options };
    assert!(matches!(dense_flow(&pyramid(30), &pyramid(30), None, &options), Err(FlowError::Option(_))));
}

/// A textured square of 56 pixels that moves by itself in front of a still world that moves by `world`.
fn with_object(world: Motion, object: Motion, noise: f64) -> [Image; 2] {
    let [mut first, mut second] = images(11, world, noise, 0.0);
    let [one, two] = images(12, object, noise, 0.0);
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            if in_object(x as f64, y as f64) {
                first.set(x, y, one.at(x, y));
            }
            let [u, v] = object.inverse(x as f64, y as f64);
            if in_object(u, v) {
                second.set(x, y, two.at(x, y));
            }
        }
    }
    [first, second]
}

fn in_object(x: f64, y: f64) -> bool {
    (50.0..106.0).contains(&x) && (30.0..86.0).contains(&y)
}

#[test]
fn what_moves_by_itself_is_found_though_the_prediction_says_otherwise() {
    let (world, object) = (Motion::shift(2.3, -0.6), Motion::shift(-4.2, 3.1));
    let plane = |value| Field::from_grid(Grid::filled(SIZE.0, SIZE.1, value));
    let prediction = FlowField::prediction(plane(2.1), plane(-0.5));
    let flow = flow_of(with_object(world, object, 2.0), Some(&prediction));
    let mut found = [vec![], vec![]];
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            // Windows near the object's edge see both motions.
            let near = |margin: f64| {
                (50.0 + margin..106.0 - margin).contains(&(x as f64))
                    && (30.0 + margin..86.0 - margin).contains(&(y as f64))
            };
            let (moves, is_clear) = (in_object(x as f64, y as f64), near(10.0) || !near(-16.0));
            if is_clear {
                let truth = if moves { object } else { world }.displacement(x as f64, y as f64);
                let answer = flow.get(x, y).map_or(f64::INFINITY, |answer| {
                    (answer.mean[0] - truth[0]).hypot(answer.mean[1] - truth[1])
                });
                found[usize::from(moves)].push(answer);
            }
        }
    }
    let [still, moving] = found.map(median);
    println!("median error of the world {still:.4} px, of the object {moving:.4} px");
    assert!(still <= 0.1 && moving <= 0.1);
}

#[test]
fn the_prediction_stands_in_as_a_guess_where_nothing_can_be_measured() {
    let flat = || Grid::filled(64, 48, 99.0);
    let plane = |value| Field::from_grid(Grid::filled(64, 48, value));
    let mut prediction = FlowField::prediction(plane(1.5), plane(-2.0));
    prediction.u.set(20, 10, None);
    let flow = flow_of([flat(), flat()], Some(&prediction));
    assert_eq!(flow.u.count(), 64 * 48 - 1);
    for (x, y) in [(0, 0), (31, 20), (63, 47)] {
        assert_eq!((flow.u.get(x, y), flow.v.get(x, y)), (Some(1.5), Some(-2.0)));
        assert!(flow.get(x, y).is_none(), "a guess is no measurement");
        assert!(flow.cov_uu.at(x, y) >= GUESS_SIGMA_PX.powi(2));
    }
    let options = FlowOptions { fill: false, ..FlowOptions::default() };
    let [a, b] = [flat(), flat()].map(|image| Pyramid::new(image, 6));
    assert_eq!(dense_flow(&a, &b, Some(&prediction), &options).unwrap().u.count(), 0);
}

#[test]
fn a_good_prediction_costs_no_accuracy_and_the_covariance_stays_true() {
    for motion in [Motion::shift(-3.3, 2.6), ROTATION_AND_ZOOM] {
        let plane = |i: usize| {
            let value = |x, y| motion.displacement(x as f64, y as f64)[i] as f32 + 0.2;
            Field::from_grid(Grid::from_fn(SIZE.0, SIZE.1, value))
        };
        let prediction = FlowField::prediction(plane(0), plane(1));
        for noise in [2.0, 8.0] {
            let flow = flow_of(images(2, motion, noise, 0.0), Some(&prediction));
            let (density, error, scores) = judge(&flow, motion);
            // Zoom, rotation and shift send a tenth and more of the pixels out of the image.
            assert!(density > 0.75 && error <= 0.05 * noise);
            assert!(scores.iter().all(|s| (0.7..=1.4).contains(s)), "{scores:?}");
        }
    }
}
