//! Dense disparity over sizes and levels: `cargo bench -p egomotion --bench disparity`.
//!
//! The scene is synthetic, a slanted plane with a nearer one before it; time hardly depends on it.

use criterion::{BenchmarkId, Criterion, Throughput};
use egomotion::geometry::Image;
use egomotion::observe::disparity::{DisparityMatcher, DisparityOptions, Matcher};

/// Grey levels of a surface, of waves from 4 to 40 pixels.
fn texture(x: f32, y: f32) -> f32 {
    let wave = |k: usize| {
        let (angle, length) = (2.4 * k as f32, 4.0 + 3.0 * k as f32);
        let (sin, cos) = angle.sin_cos();
        ((x * cos + y * sin) * std::f32::consts::TAU / length + k as f32).sin()
    };
    128.0 + 15.0 * (0..12).map(wave).sum::<f32>()
}

fn pair(width: usize, height: usize) -> (Image, Image) {
    let disparity = |u: usize, v: usize| {
        let near = (width / 3..width / 2).contains(&u) && (height / 3..height).contains(&v);
        if near { 40.0 } else { 5.0 + 20.0 * v as f32 / height as f32 }
    };
    let left = Image::from_fn(width, height, |u, v| texture(u as f32, v as f32));
    let right = Image::from_fn(width, height, |u, v| texture(u as f32 + disparity(u, v), v as f32));
    (left, right)
}

fn main() {
    let mut criterion = Criterion::default().sample_size(20).configure_from_args();
    for (name, matcher) in [("semi-global", Matcher::SemiGlobal), ("area", Matcher::AreaCorrelation)] {
        let mut group = criterion.benchmark_group(name);
        for (width, height) in [(320, 240), (640, 480), (1242, 375), (1280, 960)] {
            let (left, right) = pair(width, height);
            for levels in [32, 64, 128, 256] {
                let options = DisparityOptions { levels, matcher, ..DisparityOptions::default() };
                let mut matcher = DisparityMatcher::new(options);
                group.throughput(Throughput::Elements((width * height * levels) as u64));
                let id = BenchmarkId::new(format!("{width}x{height}"), levels);
                group.bench_function(id, |b| b.iter(|| matcher.compute(&left, &right)));
            }
        }
        group.finish();
    }
    criterion.final_summary();
}
