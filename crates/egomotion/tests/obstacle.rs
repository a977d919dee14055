//! The nearest obstacle of the rendered robot's drive, against the exact truth.

use std::collections::BTreeMap;

use egomotion::geometry::upper_median;
use egomotion::motion::ObstacleCriteria;
use egomotion::pipeline::{Config, StereoFrame, StereoMotion};
use egomotion::sim::{SensorNoise, Sequence};

/// Fewest cells of a surface that crosses; one of which as many cross by half is ahead, and not only just crossing.
const LEAST_CELLS: usize = 4;

/// Seconds from frame `k + 1` until the nearest obstacle is met, by the definition on exact values: of each
/// surface the cells of which a quarter crosses the window, their medians, and of these the tenth that comes first.
/// And whether that surface is ahead.
fn truth_s(sequence: &Sequence, k: usize) -> Option<(f64, bool)> {
    let (view, motion, window) = (sequence.view(k)?, sequence.phi(k)?.exp(), Config::default().vehicle);
    let cell = ObstacleCriteria::DENSE.cell_px;
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
    let (mut medians, mut half): (BTreeMap<u16, Vec<f64>>, BTreeMap<u16, usize>) = Default::default();
    for ((surface, ..), mut seconds) in cells {
        if 4 * seconds.len() >= cell * cell {
            *half.entry(surface).or_default() += usize::from(2 * seconds.len() >= cell * cell);
            medians.entry(surface).or_default().extend(upper_median(&mut seconds, f64::total_cmp));
        }
    }
    medians.retain(|_, medians| medians.len() >= LEAST_CELLS);
    let first = |mut medians: Vec<f64>| {
        medians.sort_by(f64::total_cmp);
        medians[(0.1 * medians.len() as f64).round() as usize]
    };
    let nearest =
        medians.into_iter().map(|(surface, medians)| (first(medians), half[&surface] >= LEAST_CELLS));
    nearest.min_by(|a, b| a.0.total_cmp(&b.0))
}

#[test]
fn the_truth_lies_in_the_interval() {
    let sequence = Sequence::named("demo", Some((320, 240)), None, 1.0).unwrap();
    let truths: Vec<_> = (1..sequence.frames()).map(|k| truth_s(&sequence, k - 1)).collect();
    let (mut ahead, mut inside, mut free, mut false_alarms) = (0, 0, 0, 0);
    for seed in 1..=3 {
        let sensor = SensorNoise::default().with_seed(seed);
        let mut motion = StereoMotion::new(sequence.rig, Config::default()).unwrap();
        for k in 0..sequence.frames() {
            let images = sensor.expose(&sequence.view(k).unwrap().render(2), k as u64);
            let time_s = sequence.interval_s * k as f64;
            let answer = motion.push(StereoFrame { time_s, left: images.left, right: images.right });
            let Some(truth) = k.checked_sub(1).and_then(|k| truths.get(k)) else { continue };
            let interval = answer.impact().and_then(|impact| impact.interval95_s());
            println!("seed {seed}, frame {k}: {truth:?}, found {interval:?}");
            match truth {
                Some((seconds, true)) => {
                    ahead += 1;
                    inside += usize::from(interval.is_some_and(|(lo, hi)| lo <= *seconds && *seconds <= hi));
                }
                Some((_, false)) => {}
                None => {
                    free += 1;
                    false_alarms += usize::from(interval.is_some());
                }
            }
        }
    }
    println!("{ahead} ahead, {inside} inside; {free} free, {false_alarms} false alarms");
    assert!(ahead >= 25 && 10 * inside >= 9 * ahead, "{inside} of {ahead}");
    assert!(free >= 20 && 20 * false_alarms <= free, "{false_alarms} of {free}");
}
