//! Time to impact of the nearest obstacle, against the rendered truth.

use std::collections::BTreeMap;

use egomotion::metrics::quantile;

use crate::outputs::dense_results;
use crate::recording::{SIZE, drive};
use crate::table::motion;

const COLUMNS: [&str; 3] = ["impact_lo_s", "impact_s", "impact_hi_s"];

/// Seconds until what a pixel shows passes through the vehicle's window (1 m square around the left
/// camera's axis), everything going on straight at its speed between the frames `k` and `k + 1`; the pixels
/// that do not are left out.
fn true_impacts_s(k: usize) -> Vec<((usize, usize), f64)> {
    let (view, motion) = (drive().view(k).unwrap(), drive().phi(k).unwrap().exp());
    let pixels = (0..SIZE.1).flat_map(|v| (0..SIZE.0).map(move |u| (u, v)));
    let impact = |(u, v)| {
        let before = view.truth_at(u as f64, v as f64)?.point;
        let later = motion.apply(&before);
        let step = later - before;
        let frames = -later.z / step.z;
        let end = later + step * frames;
        let hits = frames > 0.0 && end.x.abs() <= 0.5 && end.y.abs() <= 0.5;
        hits.then_some(((u, v), frames * drive().interval_s))
    };
    pixels.filter_map(impact).collect()
}

/// When the obstacle's nearest part is met, as another definition has it: of all blocks of 32 × 32 pixels of which
/// at least a tenth will pass through the window, the least median.
fn nearest_block_s(impacts: &[((usize, usize), f64)]) -> Option<f64> {
    let mut blocks: BTreeMap<(usize, usize), Vec<f64>> = BTreeMap::new();
    for &((u, v), seconds) in impacts {
        blocks.entry((u / 32, v / 32)).or_default().push(seconds);
    }
    blocks
        .values()
        .filter(|b| b.len() >= 32 * 32 / 10)
        .filter_map(|b| quantile(b, 0.5))
        .min_by(f64::total_cmp)
}

#[test]
fn the_columns_hold_an_interval_or_nothing() {
    for row in motion(dense_results()) {
        if COLUMNS.iter().any(|c| !row.text(c).is_empty()) {
            let [lo, at, hi] = COLUMNS.map(|c| row.number(c));
            assert!(0.0 < lo && lo <= at && at <= hi, "{lo} {at} {hi}");
        }
    }
}

#[test]
fn the_obstacle_ahead_is_found() {
    // At first the robot drives straight at the room's obstacle.
    let answer = motion(dense_results())[0].number("impact_s");
    let truth = nearest_block_s(&true_impacts_s(0)).unwrap();
    assert!((answer / truth - 1.0).abs() < 0.1, "{answer} s, truth {truth} s");
}

#[test]
fn no_obstacle_is_reported_before_the_nearest_point_arrives() {
    for (k, row) in motion(dense_results()).iter().enumerate() {
        let found = COLUMNS.map(|c| row.text(c).to_owned());
        let truth = true_impacts_s(k).iter().map(|(_, seconds)| *seconds).min_by(f64::total_cmp);
        if let Ok(hi) = found[2].parse::<f64>() {
            // With nothing in the way at all the far end must at least be far.
            let truth = truth.unwrap_or(10.0);
            assert!(
                hi >= truth,
                "frame {}: {found:?} s, the nearest point arrives in {truth} s",
                row.frame()
            );
        }
    }
}
