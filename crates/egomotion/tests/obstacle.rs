//! The nearest obstacle of the rendered robot's drive, against the exact truth.

use std::collections::BTreeMap;

use egomotion::geometry::upper_median;
use egomotion::motion::obstacle::Belief;
use egomotion::pipeline::{Config, StereoFrame, StereoMotion};
use egomotion::sim::{SensorNoise, Sequence};

/// Fewest cells of a surface that is ahead; half of each crosses: what only just crosses need not be found.
const LEAST_CELLS: usize = 4;

/// Seconds from frame `k + 1` until the nearest obstacle is met, by the definition on exact values: of each
/// surface the cells of which half crosses the window, their medians, and of these the tenth that comes first.
fn truth_s(sequence: &Sequence, k: usize) -> Option<f64> {
    let (view, motion, window) = (sequence.view(k)?, sequence.phi(k)?.exp(), Config::default().window);
    let cell = Belief::DENSE.cell_px;
    let mut cells: BTreeMap<(u16, usize, usize), Vec<f64>> = BTreeMap::new();
    for (u, v) in (0..sequence.rig.height_px).flat_map(|v| (0..sequence.rig.width_px).map(move |u| (u, v))) {
        let Some(truth) = view.truth_at(u as f64, v as f64) else { continue };
        let later = motion.apply(&truth.point);
        let velocity = (later - truth.point) / sequence.interval_s;
        let seconds = -later.z / velocity.z;
        if seconds > 0.0 && window.is_crossed_by(&later, &velocity, seconds) {
            cells.entry((truth.surface, v / cell, u / cell)).or_default().push(seconds);
        }
    }
    let mut surfaces: BTreeMap<u16, Vec<f64>> = BTreeMap::new();
    for ((surface, ..), mut seconds) in cells {
        if 2 * seconds.len() >= cell * cell {
            surfaces.entry(surface).or_default().extend(upper_median(&mut seconds, f64::total_cmp));
        }
    }
    let first = |mut medians: Vec<f64>| {
        medians.sort_by(f64::total_cmp);
        medians[(0.1 * medians.len() as f64).round() as usize]
    };
    surfaces.into_values().filter(|cells| cells.len() >= LEAST_CELLS).map(first).min_by(f64::total_cmp)
}

#[test]
fn the_truth_lies_in_the_interval() {
    let sequence = Sequence::named("demo", Some((320, 240)), None, 1.0).unwrap();
    let truths: Vec<Option<f64>> = (1..sequence.frames()).map(|k| truth_s(&sequence, k - 1)).collect();
    let (mut ahead, mut found, mut inside) = (0.0, 0.0, 0.0);
    for seed in 1..=3 {
        let sensor = SensorNoise::default().with_seed(seed);
        let mut motion = StereoMotion::new(sequence.rig, Config::default()).unwrap();
        for k in 0..sequence.frames() {
            let images = sensor.expose(&sequence.view(k).unwrap().render(2), k as u64);
            let time_s = sequence.interval_s * k as f64;
            let answer = motion.push(StereoFrame { time_s, left: images.left, right: images.right });
            let Some(&Some(truth)) = k.checked_sub(1).and_then(|k| truths.get(k)) else { continue };
            let interval = answer.impact().and_then(|impact| impact.interval95_s());
            println!("seed {seed}, frame {k}: {truth:.3} s, found {interval:?}");
            ahead += 1.0;
            found += f64::from(u8::from(interval.is_some()));
            inside += f64::from(u8::from(interval.is_some_and(|(lo, hi)| lo <= truth && truth <= hi)));
        }
    }
    println!("{ahead} ahead, {found} found, {inside} inside");
    assert!(ahead >= 30.0 && found >= 0.9 * ahead && inside >= 0.9 * ahead, "{ahead} {found} {inside}");
}
