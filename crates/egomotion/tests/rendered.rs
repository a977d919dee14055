//! Rendered pairs as input: disparity and flow computed from noisy images against the exact maps.

use egomotion::metrics::quantile;
use egomotion::observe::{DisparityMatcher, DisparityOptions, FlowOptions, Pyramid, dense_flow};
use egomotion::sim::{IN_LATER, IN_RIGHT, SensorNoise, Sequence};

const LARGEST_MEDIAN_PX: f64 = 0.1;

/// Median error of computed disparity and flow (endpoint), in pixels, over the pixels whose point the other
/// image shows; a pixel without an answer counts as infinitely wrong.
fn medians(sequence: &Sequence, noise: &SensorNoise) -> [f64; 2] {
    let [view, next] = [0, 1].map(|k| sequence.view(k).unwrap());
    let [pair, later] = [(&view, 0), (&next, 1)].map(|(view, k)| noise.photograph(view, 3, k));
    let truth = view.truth_maps(sequence.phi(0).as_ref());
    let disparity =
        DisparityMatcher::new(DisparityOptions::default()).compute(&pair.left, &pair.right).unwrap();
    let [from, to] = [pair.left, later.left].map(|image| Pyramid::new(image, 6));
    let flow = dense_flow(&from, &to, None, &FlowOptions::default()).unwrap();
    let (mut shifts, mut ends) = (Vec::new(), Vec::new());
    let off = |found: Option<f32>, exact: Option<f32>| match (found, exact) {
        (Some(found), Some(exact)) => f64::from(found - exact),
        _ => f64::INFINITY,
    };
    for v in 0..sequence.rig.height_px {
        for u in 0..sequence.rig.width_px {
            if truth.visible.at(u, v) & IN_RIGHT != 0 {
                shifts.push(off(disparity.shift.get(u, v), truth.shift.get(u, v)).abs());
            }
            if truth.visible.at(u, v) & IN_LATER != 0 {
                let [x, y] = &truth.flow;
                ends.push(off(flow.u.get(u, v), x.get(u, v)).hypot(off(flow.v.get(u, v), y.get(u, v))));
            }
        }
    }
    let answered =
        |errors: &[f64]| 100.0 * errors.iter().filter(|e| e.is_finite()).count() as f64 / errors.len() as f64;
    let result = [&shifts, &ends].map(|errors| quantile(errors, 0.5).unwrap());
    println!(
        "{} {}x{}: disparity {:.4} px ({:.1} % answered), flow {:.4} px ({:.1} %)",
        sequence.name,
        sequence.rig.width_px,
        sequence.rig.height_px,
        result[0],
        answered(&shifts),
        result[1],
        answered(&ends)
    );
    result
}

#[test]
fn disparity_and_flow_of_rendered_pairs_are_good_to_a_tenth_of_a_pixel() {
    for name in ["C", "drive"] {
        for size in [(320, 240), (640, 480)] {
            let sequence = Sequence::named(name, Some(size), Some(2), 1.0).unwrap();
            let [disparity, flow] = medians(&sequence, &SensorNoise::default().with_seed(1));
            assert!(
                disparity < LARGEST_MEDIAN_PX && flow < LARGEST_MEDIAN_PX,
                "{name} {size:?} {disparity} {flow}"
            );
        }
    }
}

#[test]
fn blur_takes_texture_and_with_it_accuracy() {
    // The noise stays as it is and the texture fades, so both errors grow; disparity stays good.
    let sequence = Sequence::named("C", Some((320, 240)), Some(2), 1.0).unwrap();
    let plain = SensorNoise::default().with_seed(1);
    let blurred = SensorNoise { blur_px: 1.0, vignetting: 0.4, ..plain };
    let [sharp, soft] = [plain, blurred].map(|sensor| medians(&sequence, &sensor));
    assert!(soft[0] > 1.2 * sharp[0] && soft[1] > 1.2 * sharp[1], "{soft:?} {sharp:?}");
    assert!(soft[0] < LARGEST_MEDIAN_PX, "{soft:?}");
}
