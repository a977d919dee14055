//! Sparse tracks of rendered frames against the exact truth: places, disparities, and what they say of their errors.

use egomotion::geometry::{RigidMotion, StereoRig};
use egomotion::metrics::quantile;
use egomotion::observe::StereoPyramid;
use egomotion::observe::tracks::{
    Hints, SearchStart, StereoCorner, TrackOptions, follow, stereo_corners, tracks_from_traces,
};
use egomotion::sim::{SensorNoise, Sequence};
use nalgebra::{Matrix3, Vector3};

/// Errors of all tracks of a sequence.
#[derive(Default)]
struct Errors {
    /// Distance of the later place from where the point is, in pixels.
    place: Vec<f64>,
    /// Error of the earlier disparity, in pixels.
    disparity: Vec<f64>,
    /// eᵀ S⁻¹ e / 3 of the later (x, y, d) against where the point at the earlier (x, y) truly is.
    nees: Vec<f64>,
    /// Ages of the corners in the last frame.
    ages: Vec<f64>,
}

/// Corners followed over `frames` frames, each pair with nothing known but what was followed before.
fn errors(name: &str, frames: usize, noise: &SensorNoise) -> Errors {
    let sequence = Sequence::named(name, Some((640, 480)), Some(frames), 1.0).unwrap();
    let (rig, options) = (&sequence.rig, TrackOptions::default());
    let mut found = Errors::default();
    let pyramid = |k: usize| {
        let images = noise.photograph(&sequence.view(k).unwrap(), 3, k as u64);
        StereoPyramid::new(&images.left, &images.right, options.pyramid_levels)
    };
    let (mut before, mut kept) = (pyramid(0), Vec::<StereoCorner>::new());
    for k in 0..frames - 1 {
        let (after, view, phi) = (pyramid(k + 1), sequence.view(k).unwrap(), sequence.phi(k).unwrap());
        let hints = Hints { motion: Some(&phi), ..Hints::default() };
        let corners = stereo_corners(&before, &kept, rig, Hints::default(), &options);
        let traces = follow(&before, &after, &corners, rig, hints, SearchStart::FullResolution, &options);
        let motion = phi.exp();
        for track in tracks_from_traces(&traces, rig) {
            let (u, v) = rig.pixel_from_image(track.before.mean.x, track.before.mean.y);
            let Some(truth) = view.truth_at(u, v) else { continue };
            let Some(later) = view.motion_at(&truth, &phi).later_xyd else { continue };
            found.place.push((track.after.mean - later).xy().norm());
            found.disparity.push((track.before.mean.z - truth.xyd.z).abs());
            // The window was taken at (x, y) exactly, but with noise that moves where it is found.
            let template = [0, 1].map(|k| by_place(rig, &motion, &truth.xyd).column(k).into_owned());
            let before = &track.before.cov;
            let cov =
                (0..2).flat_map(|i| (0..2).map(move |j| (i, j))).fold(track.after.cov, |sum, (i, j)| {
                    sum + before[(i, j)] * template[i] * template[j].transpose()
                });
            let error = track.after.mean - later;
            found.nees.push(error.dot(&(cov.try_inverse().unwrap() * error)) / 3.0);
        }
        kept = traces.iter().map(|trace| trace.after).collect();
        before = after;
    }
    found.ages = kept.iter().map(|corner| f64::from(corner.age)).collect();
    found
}

/// ∂(x′, y′, d′)/∂(x, y, d) of a still point.
fn by_place(rig: &StereoRig, motion: &RigidMotion, xyd: &Vector3<f64>) -> Matrix3<f64> {
    let moved = motion.apply(&rig.point(xyd).unwrap());
    rig.project_jacobian(&moved) * motion.rotation * rig.point_jacobian(xyd)
}

/// Mean within three median absolute deviations (scaled to σ) of the median, and the share beyond.
fn core(values: &[f64]) -> (f64, f64) {
    let median = quantile(values, 0.5).unwrap();
    let apart: Vec<f64> = values.iter().map(|v| (v - median).abs()).collect();
    let reach = 3.0 * 1.4826 * quantile(&apart, 0.5).unwrap();
    let inside: Vec<f64> = values.iter().copied().filter(|v| (v - median).abs() <= reach).collect();
    (inside.iter().sum::<f64>() / inside.len() as f64, 1.0 - inside.len() as f64 / values.len() as f64)
}

#[test]
fn tracks_are_good_to_a_twentieth_of_a_pixel_and_know_their_errors() {
    for name in ["C", "drive"] {
        let found = errors(name, 5, &SensorNoise::default().with_seed(1));
        let [place, disparity, age] =
            [&found.place, &found.disparity, &found.ages].map(|values| quantile(values, 0.5).unwrap());
        let (nees, tail) = core(&found.nees);
        println!(
            "{name}: {} tracks, place {place:.4} px, disparity {disparity:.4} px, NEES/3 {nees:.3} in the core, {:.1} % beyond; age {age}",
            found.nees.len(),
            100.0 * tail
        );
        assert!(found.nees.len() > 2500, "{name} {}", found.nees.len());
        assert!(place < 0.05 && disparity < 0.05, "{name} {place} {disparity}");
        assert!((0.8..1.25).contains(&nees) && tail < 0.15, "{name} {nees} {tail}");
        // Four pairs: a corner of the first frame that was never lost has seen four frames before.
        assert!(age >= 3.0, "{name} {age}");
    }
}

#[test]
fn a_change_of_brightness_between_the_cameras_changes_little() {
    let plain = errors("C", 2, &SensorNoise::default().with_seed(1));
    let unequal = SensorNoise { right_gain: 1.2, right_offset: -15.0, ..SensorNoise::default() };
    let uneven = errors("C", 2, &unequal.with_seed(1));
    assert!(uneven.nees.len() as f64 > 0.95 * plain.nees.len() as f64);
    let median = |found: &Errors| quantile(&found.disparity, 0.5).unwrap();
    assert!(median(&uneven) < 1.2 * median(&plain), "{} {}", median(&uneven), median(&plain));
}
