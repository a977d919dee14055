//! Where a lens ends: what neither image shows gives no disparity and no track.

use egomotion::geometry::{Grid, Image, StereoRig};
use egomotion::observe::StereoPyramid;
use egomotion::observe::tracks::{Hints, TrackOptions, stereo_corners};
use egomotion::pipeline::{Config, StereoFrame, StereoMotion};
use egomotion::sim::{SensorNoise, Sequence};

const SIZE: (usize, usize) = (320, 240);
/// Radius of the circle that a fisheye lens shows, in pixels.
const CIRCLE_PX: f64 = 140.0;

/// What lies beyond the lens of a camera whose axis is at column `cx`.
fn beyond(cx: f64) -> Grid<bool> {
    Grid::from_fn(SIZE.0, SIZE.1, |u, v| (u as f64 - cx).hypot(v as f64 - 119.5) > CIRCLE_PX)
}

/// What a rectified image shows there: nothing, or the border of what is seen, repeated.
fn end(image: &Image, mask: &Grid<bool>, cx: f64, repeated: bool) -> Image {
    Grid::from_fn(SIZE.0, SIZE.1, |u, v| {
        if !mask.at(u, v) {
            return image.at(u, v);
        }
        let (x, y) = (u as f64 - cx, v as f64 - 119.5);
        let share = (CIRCLE_PX - 1.0) / x.hypot(y);
        let border = |c: f64, last: usize| c.round().clamp(0.0, last as f64) as usize;
        let place = (border(cx + share * x, SIZE.0 - 1), border(119.5 + share * y, SIZE.1 - 1));
        if repeated { image.at(place.0, place.1) } else { 0.0 }
    })
}

/// The pair of frame `k` through lenses that end.
fn frame(sequence: &Sequence, k: usize, masks: &[Grid<bool>; 2], repeated: bool) -> StereoFrame {
    let seen = SensorNoise::default().with_seed(3).expose(&sequence.view(k).unwrap().render(2), k as u64);
    let left = end(&seen.left, &masks[0], LEFT_CX, repeated);
    let right = end(&seen.right, &masks[1], RIGHT_CX, repeated);
    StereoFrame { time_s: k as f64, left, right }
}

/// The lenses do not end at the same columns.
const LEFT_CX: f64 = 165.0;
const RIGHT_CX: f64 = 150.0;

/// Disparities that belong to no pixel of one of the images.
fn beyond_the_lens(shift: impl Fn(usize, usize) -> Option<f32>, [left, right]: &[Grid<bool>; 2]) -> usize {
    let all = (0..SIZE.1).flat_map(|v| (0..SIZE.0).map(move |u| (u, v)));
    all.filter(|&(u, v)| {
        let partner = shift(u, v).map(|shift| (u as f32 - shift).round() as usize);
        partner.is_some_and(|partner| left.at(u, v) || partner < SIZE.0 && right.at(partner, v))
    })
    .count()
}

#[test]
fn no_disparity_where_a_lens_ends() {
    let sequence = Sequence::named("C", Some(SIZE), Some(2), 1.0).unwrap();
    let masks = [beyond(LEFT_CX), beyond(RIGHT_CX)];
    for repeated in [false, true] {
        let frames = [0, 1].map(|k| frame(&sequence, k, &masks, repeated));
        let run = |masked: bool| {
            let mut motion = StereoMotion::new(sequence.rig, Config::default()).unwrap();
            if masked {
                let [left, right] = masks.clone();
                motion.set_mask(Some(left));
                motion.set_right_mask(Some(right));
            }
            motion.push(frames[0].clone());
            motion.push(frames[1].clone())
        };
        let [free, masked] = [run(false), run(true)].map(|answer| {
            let maps = answer.dense.unwrap();
            let disparity = maps.disparity.shift;
            let velocity = beyond_the_lens(
                |u, v| maps.motion.depth_velocity.get(u, v).and_then(|_| disparity.get(u, v)),
                &masks,
            );
            let error = answer.motion.unwrap().theta.mean - sequence.phi(0).unwrap().vector();
            (beyond_the_lens(|u, v| disparity.get(u, v), &masks), velocity, disparity.count(), error.norm())
        });
        println!("{repeated} {free:?} {masked:?}");
        assert!(free.0 > 100, "without masks the lens' ends have disparities: {}", free.0);
        assert_eq!((masked.0, masked.1), (0, 0));
        // What is seen is answered all the same, and the motion does not suffer.
        assert!(masked.2 > 45_000 && masked.2 < free.2, "{masked:?} {free:?}");
        assert!(masked.3 < 3e-4, "{masked:?}");
    }
}

#[test]
fn no_track_where_a_lens_ends() {
    let sequence = Sequence::named("C", Some(SIZE), Some(1), 1.0).unwrap();
    // Half of the right image is not to be used, though it shows what the left one does.
    let half = Grid::from_fn(SIZE.0, SIZE.1, |u, _| u < 160);
    let seen = SensorNoise::default().with_seed(3).expose(&sequence.view(0).unwrap().render(2), 0);
    let images = StereoPyramid::new(&seen.left, &seen.right, 5);
    let rig: &StereoRig = &sequence.rig;
    let corners = |mask_right| {
        let hints = Hints { mask_right, ..Hints::default() };
        stereo_corners(&images, &[], rig, hints, &TrackOptions::default())
    };
    let in_half = |u: f64| u.round() < 160.0;
    let (all, kept) = (corners(None), corners(Some(&half)));
    let there = all.iter().filter(|corner| in_half(corner.u - corner.shift)).count();
    assert!(there > 50 && kept.len() == all.len() - there, "{there} {} {}", kept.len(), all.len());
    assert!(kept.iter().all(|corner| !in_half(corner.u - corner.shift)));
}
