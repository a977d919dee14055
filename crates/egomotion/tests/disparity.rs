//! Dense disparity of small synthetic pairs whose truth is exact.

use egomotion::geometry::{Field, Image};
use egomotion::observe::disparity::{
    DisparityError, DisparityMap, DisparityMatcher, DisparityOptions, GUESS_SIGMA_PX, Matcher,
};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const SIZE: (usize, usize) = (200, 120);

/// A texture with wavelengths of 5 … 40 pixels, known at every point.
struct Texture(Vec<[f64; 4]>);

impl Texture {
    fn new(seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let waves = (0..160).map(|_| {
            let wave_number = std::f64::consts::TAU / random.random_range(5.0_f64..40.0);
            let direction = random.random_range(0.0..std::f64::consts::TAU);
            let phase = random.random_range(0.0..std::f64::consts::TAU);
            [wave_number * direction.cos(), wave_number * direction.sin(), phase, 30.0 / 160.0_f64.sqrt()]
        });
        Self(waves.collect())
    }

    fn grey(&self, x: f64, y: f64) -> f64 {
        128.0 + self.0.iter().map(|[kx, ky, phase, a]| a * (kx * x + ky * y + phase).sin()).sum::<f64>()
    }
}

/// A plane whose disparity is that of the left pixel, d = a + b u + c v.
#[derive(Clone, Copy)]
struct Plane(f64, f64, f64);

impl Plane {
    fn at(self, u: f64, v: f64) -> f64 {
        self.0 + self.1 * u + self.2 * v
    }

    /// Left column seen at column `x` of the right image: u = x + d(u, v).
    fn left_column(self, x: f64, v: f64) -> f64 {
        (x + self.0 + self.2 * v) / (1.0 - self.1)
    }
}

/// The pair of a plane painted on the left image, with noise of `sigma` grey levels.
fn plane_pair(plane: Plane, sigma: f64, seed: u64) -> (Image, Image) {
    let texture = Texture::new(seed);
    let mut random = Pcg64Mcg::seed_from_u64(seed + 1);
    let mut noise = || sigma * Distribution::<f64>::sample(&StandardNormal, &mut random);
    let left = Image::from_fn(SIZE.0, SIZE.1, |u, v| (texture.grey(u as f64, v as f64) + noise()) as f32);
    let right = Image::from_fn(SIZE.0, SIZE.1, |x, v| {
        (texture.grey(plane.left_column(x as f64, v as f64), v as f64) + noise()) as f32
    });
    (left, right)
}

fn options() -> DisparityOptions {
    DisparityOptions { levels: 48, fill: false, ..DisparityOptions::default() }
}

fn compute(left: &Image, right: &Image) -> DisparityMap {
    DisparityMatcher::new(options()).compute(left, right).expect("one size")
}

/// (error, σ, true disparity) of every pixel that has a value.
fn errors(map: &DisparityMap, plane: Plane) -> Vec<(f64, f64, f64)> {
    let pixels = (0..SIZE.1).flat_map(|v| (0..SIZE.0).map(move |u| (u, v)));
    let answered = pixels.filter_map(|(u, v)| {
        let truth = plane.at(u as f64, v as f64);
        let (shift, sigma) = (map.shift.get(u, v)?, map.sigma.get(u, v)?);
        Some((f64::from(shift) - truth, f64::from(sigma), truth))
    });
    answered.collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    assert!(!values.is_empty());
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// 1.4826 × the median absolute deviation from the median.
fn robust_deviation(values: &[f64]) -> f64 {
    let centre = median(values.to_vec());
    1.4826 * median(values.iter().map(|v| (v - centre).abs()).collect())
}

#[test]
fn planes_are_found_to_a_tenth_of_a_pixel_and_sigma_is_honest() {
    let planes =
        [Plane(7.3, 0.0, 0.0), Plane(6.0, 0.06, 0.0), Plane(4.0, -0.01, 0.15), Plane(12.0, 0.03, 0.08)];
    for (seed, plane) in (10..).zip(planes) {
        for noise in [1.0, 3.0] {
            let (left, right) = plane_pair(plane, noise, seed);
            let errors = errors(&compute(&left, &right), plane);
            let inside = (SIZE.0 as f64 - plane.at(0.0, SIZE.1 as f64)) * SIZE.1 as f64;
            assert!(errors.len() as f64 > 0.8 * inside, "{} pixels of {inside}", errors.len());
            let error = median(errors.iter().map(|e| e.0.abs()).collect());
            let z: Vec<f64> = errors.iter().map(|(e, sigma, _)| e / sigma).collect();
            let spread = robust_deviation(&z);
            assert!(error < 0.1, "median error {error} px");
            assert!((0.7..1.4).contains(&spread), "robust deviation of error/sigma {spread}");
        }
    }
}

#[test]
fn no_disparity_is_locked_to_whole_pixels() {
    let plane = Plane(5.0, 0.02, 0.05);
    let (left, right) = plane_pair(plane, 1.0, 31);
    let errors = errors(&compute(&left, &right), plane);
    for bin in 0..8 {
        let phase = |d: f64| (d.rem_euclid(1.0) * 8.0) as usize == bin;
        let bias = median(errors.iter().filter(|e| phase(e.2)).map(|e| e.0).collect());
        assert!(bias.abs() < 0.03, "bias {bias} px at a fraction of {}", bin as f64 / 8.0);
    }
}

/// A square of disparity 20 in front of a background of disparity 6: the square covers the columns
/// 90 … 140 and the rows 30 … 90 of the left image.
fn square_pair() -> (Image, Image) {
    let (background, square) = (Texture::new(50), Texture::new(51));
    let (near, far) = (20.0, 6.0);
    let inside = |u: f64, v: f64| (90.0..140.0).contains(&u) && (30.0..90.0).contains(&v);
    let view = |d_near: f64, d_far: f64| {
        Image::from_fn(SIZE.0, SIZE.1, |x, v| {
            let (x, v) = (x as f64, v as f64);
            let grey = if inside(x + d_near, v) {
                square.grey(x + d_near, v)
            } else {
                background.grey(x + d_far, v)
            };
            grey as f32
        })
    };
    (view(0.0, 0.0), view(near, far))
}

/// Share of the rows of the square and the given columns whose (disparity, σ) passes a test.
fn share(
    map: &DisparityMap,
    columns: std::ops::Range<usize>,
    test: impl Fn(Option<(f32, f32)>) -> bool,
) -> f64 {
    let pixels = columns.clone().flat_map(|u| (34..86).map(move |v| (u, v)));
    let value = |(u, v)| map.shift.get(u, v).zip(map.sigma.get(u, v));
    pixels.filter(|&at| test(value(at))).count() as f64 / (columns.len() * 52) as f64
}

#[test]
fn hidden_background_stays_missing() {
    let (left, right) = square_pair();
    let map = compute(&left, &right);
    // The square hides the 14 background columns left of it from the right camera.
    let hidden = share(&map, 78..88, |d| d.is_none());
    let seen = share(&map, 94..136, |d| d.is_some_and(|d| (d.0 - 20.0).abs() < 0.5));
    let beyond = share(&map, 146..190, |d| d.is_some_and(|d| (d.0 - 6.0).abs() < 0.5));
    assert!(hidden > 0.9, "{hidden} of the hidden pixels are missing");
    assert!(seen > 0.95 && beyond > 0.95, "{seen} of the square, {beyond} of the background");
}

#[test]
fn what_is_filled_in_is_behind_and_says_that_it_is_a_guess() {
    let (left, right) = square_pair();
    let filled = DisparityMatcher::new(DisparityOptions { fill: true, ..options() });
    let map = filled.clone().compute(&left, &right).expect("one size");
    let behind = share(&map, 78..88, |d| d.is_some_and(|d| (d.0 - 6.0).abs() < 1.0));
    let guessed = share(&map, 78..88, |d| d.is_some_and(|d| d.1 >= GUESS_SIGMA_PX));
    assert!(behind > 0.9 && guessed > 0.9, "{behind} behind, {guessed} guessed");
    // What is measured stays as it is, but beside what was filled in it may be of that surface.
    let measured = compute(&left, &right);
    for (u, v) in (0..SIZE.1).flat_map(|v| (0..SIZE.0).map(move |u| (u, v))) {
        if measured.shift.get(u, v).is_some() {
            assert_eq!(measured.shift.get(u, v), map.shift.get(u, v));
            assert!(measured.sigma.get(u, v) <= map.sigma.get(u, v));
        }
    }
}

#[test]
fn area_correlation_answers_to_a_sixteenth() {
    for (seed, plane) in (20..).zip([Plane(6.0, 0.04, 0.02), Plane(11.0, -0.01, 0.05)]) {
        let (left, right) = plane_pair(plane, 1.0, seed);
        let options = DisparityOptions { matcher: Matcher::AreaCorrelation, ..options() };
        let map = DisparityMatcher::new(options).compute(&left, &right).expect("one size");
        let errors = errors(&map, plane);
        assert!(errors.len() > 12_000, "{} pixels", errors.len());
        assert!(map.shift.grid().values().iter().all(|d| d.is_nan() || (d * 16.0).fract() == 0.0));
        let error = median(errors.iter().map(|e| e.0.abs()).collect());
        let spread = robust_deviation(&errors.iter().map(|(e, sigma, _)| e / sigma).collect::<Vec<_>>());
        assert!(error < 0.15, "median error {error} px");
        assert!((0.6..1.5).contains(&spread), "robust deviation of error/sigma {spread}");
    }
}

#[test]
fn rows_that_disagree_do_not_look_like_disparity() {
    // Slanted waves alone: a third of a row would be 0.2 px of disparity.
    let plane = Plane(9.0, 0.0, 0.05);
    let texture = Texture::new(97);
    let wave = |x: f64, y: f64| {
        128.0
            + 40.0 * (0.5 * x + 0.3 * y).sin()
            + 15.0 * (0.1 * y).cos() * (0.7 * y).sin()
            + 0.3 * texture.grey(x, y)
    };
    let left = Image::from_fn(SIZE.0, SIZE.1, |u, v| wave(u as f64, v as f64) as f32);
    let right = Image::from_fn(SIZE.0, SIZE.1, |x, v| {
        let row = v as f64 - 0.33;
        wave(plane.left_column(x as f64, row), row) as f32
    });
    let errors = errors(&compute(&left, &right), plane);
    let bias = median(errors.iter().map(|e| e.0).collect());
    assert!(errors.len() > 12_000 && bias.abs() < 0.06, "{} pixels, bias {bias} px", errors.len());
}

#[test]
fn brightness_and_grey_scale_do_not_matter() {
    let plane = Plane(9.4, 0.0, 0.1);
    let (left, right) = plane_pair(plane, 1.0, 60);
    let scaled = |image: &Image, gain: f32, offset: f32| {
        Image::from_fn(SIZE.0, SIZE.1, |u, v| gain * image.at(u, v) + offset)
    };
    // From 8 to 16 bits, the right camera brighter.
    let map = compute(&scaled(&left, 200.0, 0.0), &scaled(&right, 200.0, 4000.0));
    let errors = errors(&map, plane);
    assert!(errors.len() > 15_000);
    assert!(median(errors.iter().map(|e| e.0.abs()).collect()) < 0.1);
}

#[test]
fn without_texture_there_is_no_answer() {
    let grey = Image::filled(90, 60, 17.0);
    let map = compute(&grey, &grey);
    assert_eq!((map.shift.count(), map.sigma.count()), (0, 0));
}

#[test]
fn tiny_images_have_no_answer() {
    for (width, height) in [(1, 1), (1, 9), (9, 1), (2, 2), (3, 5), (7, 7), (0, 0), (0, 4)] {
        let image = Image::from_fn(width, height, |u, v| ((u * 31 + v * 17) % 7) as f32);
        let map = compute(&image, &image);
        assert_eq!((map.shift.size(), map.shift.count()), ((width, height), 0));
        assert_eq!(map.sigma.size(), (width, height));
    }
}

#[test]
fn odd_input_does_not_panic() {
    let texture = Texture::new(70);
    let mut image = Image::from_fn(70, 40, |u, v| texture.grey(u as f64, v as f64) as f32);
    image.set(30, 20, f32::NAN);
    image.set(31, 22, f32::INFINITY);
    let extreme = DisparityOptions {
        levels: usize::MAX,
        uniqueness: f32::NAN,
        speckle_size: usize::MAX,
        ..DisparityOptions::default()
    };
    for options in [options(), DisparityOptions { levels: 0, ..options() }, extreme] {
        let map = DisparityMatcher::new(options).compute(&image, &image).expect("one size");
        let finite = |field: &Field| field.grid().values().iter().all(|v| v.is_nan() || v.is_finite());
        assert!(finite(&map.shift) && finite(&map.sigma));
    }
}

#[test]
fn images_of_two_sizes_are_refused() {
    let (left, right) = (Image::filled(40, 30, 0.0), Image::filled(40, 31, 0.0));
    let answer = DisparityMatcher::new(options()).compute(&left, &right);
    assert_eq!(answer, Err(DisparityError::SizeMismatch { left: (40, 30), right: (40, 31) }));
}

#[test]
fn the_answer_depends_neither_on_threads_nor_on_the_pair_before() {
    let plane = Plane(8.0, 0.02, 0.05);
    let (left, right) = plane_pair(plane, 2.0, 80);
    let (other, _) = plane_pair(plane, 2.0, 81);
    let bits = |map: &DisparityMap| -> Vec<u32> {
        let planes = [map.shift.grid(), map.sigma.grid()];
        planes.iter().flat_map(|plane| plane.values().iter().map(|v| v.to_bits())).collect()
    };
    let alone = compute(&left, &right);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let mut matcher = DisparityMatcher::new(options());
            matcher.compute(&other, &right).expect("one size");
            let small = Image::filled(20, 10, 1.0);
            matcher.compute(&small, &small).expect("one size");
            let map = matcher.compute(&left, &right).expect("one size");
            assert_eq!(bits(&map), bits(&alone));
        });
    }
}

#[test]
fn identical_images_have_no_disparity_and_a_small_sigma() {
    let (left, _) = plane_pair(Plane(0.0, 0.0, 0.0), 1.0, 90);
    let map = compute(&left, &left);
    let errors = errors(&map, Plane(0.0, 0.0, 0.0));
    assert!(errors.len() as f64 > 0.9 * (SIZE.0 * SIZE.1) as f64);
    assert!(median(errors.iter().map(|e| e.0.abs()).collect()) < 0.01);
    assert!(median(errors.iter().map(|e| e.1).collect()) < 0.05);
}

#[test]
fn options_are_read_by_name_and_unknown_ones_refused() {
    let read = |text| serde_json::from_str::<DisparityOptions>(text);
    let expected = DisparityOptions { levels: 64, ..DisparityOptions::default() };
    assert_eq!(read(r#"{ "levels": 64, "matcher": "semi-global" }"#).ok(), Some(expected));
    assert!(read(r#"{ "level": 64 }"#).is_err());
}
