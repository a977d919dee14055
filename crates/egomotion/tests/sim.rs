//! The synthetic world against what it claims: exact truth, and images that agree with it.

use egomotion::geometry::{Image, Twist, image_flow};
use egomotion::sim::{MotionTruth, PointTruth, Sequence, field_of};
use nalgebra::Vector3;

fn pixels() -> impl Iterator<Item = (f64, f64)> {
    (0..15).flat_map(|j| (0..20).map(move |i| (16.0 * f64::from(i) + 3.0, 16.0 * f64::from(j) + 5.0)))
}

/// Every truth of a coarse grid of pixels at frame 0 of a paper sequence.
fn each(name: &str, mut check: impl FnMut(&Sequence, &Twist, f64, f64, PointTruth, MotionTruth)) {
    let sequence = Sequence::named(name, None, None, 1.0).unwrap();
    let (view, phi) = (sequence.view(0).unwrap(), sequence.phi(0).unwrap());
    for (u, v) in pixels() {
        let point = view.truth_at(u, v).unwrap();
        check(&sequence, &phi, u, v, point, view.motion_at(&point, &phi));
    }
}

#[test]
fn discrete_displacement_is_the_projection_of_the_moved_point() {
    for name in ["A", "B", "C", "drive"] {
        each(name, |sequence, phi, u, v, point, motion| {
            // Pinhole written out, from a point rebuilt from the disparity.
            let (rig, d) = (&sequence.rig, point.disparity_px());
            let (x, y) = (u - rig.cx_px, v - rig.cy_px);
            let p = Vector3::new(x, y, rig.focal_px) * (rig.baseline_m / d);
            assert!((p - point.point).norm() < 1e-12);
            let q = phi.exp().apply(&p);
            let moved = motion.displacement_px(&point).unwrap();
            assert!((moved.x - (rig.focal_px * q.x / q.z - x)).abs() < 1e-9);
            assert!((moved.y - (rig.focal_px * q.y / q.z - y)).abs() < 1e-9);
            assert!((motion.depth_change_m(&point) - (q.z - p.z)).abs() < 1e-12);
        });
    }
}

#[test]
fn differential_flow_of_both_cameras_is_equation_3_of_their_own_twists() {
    each("C", |sequence, _, _, _, point, motion| {
        // From the table's φ of the cyclopean camera, not from the left one that the truth starts from.
        let (rig, phi) = (&sequence.rig, sequence.phi_cyclopean(0).unwrap());
        let half = Vector3::new(0.5 * rig.baseline_m, 0.0, 0.0);
        let at = |x: f64, phi: Twist| image_flow(&phi, x, point.xyd.y, point.depth_m(), rig.focal_px);
        assert!((motion.flow_left - at(point.xyd.x, phi.seen_from(&-half))).norm() < 1e-10);
        let right = at(point.xyd.x - point.disparity_px(), phi.seen_from(&half));
        assert!((motion.flow_right - right).norm() < 1e-10);
    });
}

#[test]
fn differential_truth_is_the_limit_of_the_discrete_one() {
    let sequence = Sequence::named("C", None, None, 1.0).unwrap();
    let (view, phi) = (sequence.view(0).unwrap(), sequence.phi(0).unwrap());
    let h = 1e-4;
    for (u, v) in pixels() {
        let point = view.truth_at(u, v).unwrap();
        let now = view.motion_at(&point, &phi);
        let [ahead, back] = [h, -h].map(|h| view.motion_at(&point, &phi.scaled(h)).later_xyd.unwrap());
        let rate = (ahead - back) / (2.0 * h);
        assert!((rate.xy() - now.flow_left).norm() < 1e-6);
        assert!((rate.z - (now.flow_left.x - now.flow_right.x)).abs() < 1e-6);
    }
}

#[test]
fn depth_velocity_is_that_of_the_table() {
    // Instantaneous VZ = −15 mm + 0.1° (Y − X), X and Y of the cyclopean frame.
    each("C", |sequence, _, _, _, point, motion| {
        let p = point.point + sequence.rig.left_from_cyclopean();
        assert!((motion.velocity.z - (-0.015 + 0.1_f64.to_radians() * (p.y - p.x))).abs() < 1e-12);
    });
}

#[test]
fn later_visibility_is_a_cast_from_the_next_frame() {
    let sequence = Sequence::named("drive", None, Some(2), 6.0).unwrap();
    let [view, next] = [0, 1].map(|k| sequence.view(k).unwrap());
    let phi = sequence.phi(0).unwrap();
    let (truth, mut hidden) = (view.truth(), 0);
    for (point, motion) in truth.values().iter().zip(view.motion(&truth, &phi).values()) {
        let (point, motion) = (point.unwrap(), motion.unwrap());
        let (u, v) = sequence.rig.pixel_from_image(motion.later_xyd.unwrap().x, motion.later_xyd.unwrap().y);
        if !((0.0..=319.0).contains(&u) && (0.0..=239.0).contains(&v)) {
            assert!(!motion.in_later);
            continue;
        }
        // The next frame, looked at where the point should be, sees the point or something nearer.
        let there = next.truth_at(u, v).unwrap().depth_m() - motion.later.z;
        assert!(there < 1e-5 * motion.later.z, "{u} {v} {there}");
        assert_eq!(motion.in_later, there > -1e-5 * motion.later.z, "{u} {v} {there} {point:?}");
        hidden += usize::from(!motion.in_later);
    }
    assert!(hidden > 500, "{hidden}");
}

#[test]
fn fields_hold_the_truth_and_its_holes() {
    let sequence = Sequence::named("A", None, None, 1.0).unwrap();
    let truth = sequence.view(0).unwrap().truth();
    let disparity = field_of(&truth, |t| t.in_right.then_some(t.disparity_px()));
    assert_eq!(disparity.count(), truth.values().iter().flatten().filter(|t| t.in_right).count());
    assert!(disparity.density() > 0.85 && disparity.density() < 1.0);
    // The front wall at 6 m: d = 0.13 · 416.667 / 6.
    assert!((f64::from(disparity.get(160, 20).unwrap()) - 0.13 * 5.0 / 0.012 / 6.0).abs() < 1e-5);
}

/// Shares of the visible pixels whose grey level is found again within 3 and 8 levels.
fn constancy(earlier: &Image, later: &Image, at: impl Fn(usize, usize) -> Option<(f64, f64)>) -> (f64, f64) {
    let (mut close, mut near, mut all) = (0, 0, 0);
    for v in 0..earlier.height() {
        for u in 0..earlier.width() {
            let Some(found) = at(u, v).and_then(|(u, v)| later.sample(u, v)) else { continue };
            let off = (f64::from(earlier.at(u, v)) - found).abs();
            close += usize::from(off < 3.0);
            near += usize::from(off < 8.0);
            all += 1;
        }
    }
    assert!(all > earlier.values().len() / 2, "{all}");
    (close as f64 / all as f64, near as f64 / all as f64)
}

#[test]
fn brightness_is_constant_between_cameras_and_frames() {
    for name in ["C", "drive", "demo"] {
        let sequence = Sequence::named(name, None, None, 1.0).unwrap();
        let [view, next] = [0, 1].map(|k| sequence.view(k).unwrap());
        let (rig, phi, truth) = (&sequence.rig, sequence.phi(0).unwrap(), view.truth());
        let (pair, later) = (view.render(3), next.render(3));
        let stereo = constancy(&pair.left, &pair.right, |u, v| {
            truth.at(u, v).filter(|t| t.in_right).map(|t| (u as f64 - t.disparity_px(), v as f64))
        });
        let time = constancy(&pair.left, &later.left, |u, v| {
            let motion = view.motion_at(&truth.at(u, v)?, &phi);
            let xyd = motion.later_xyd.filter(|_| motion.in_later)?;
            Some(rig.pixel_from_image(xyd.x, xyd.y))
        });
        println!("{name}: stereo {stereo:?}, time {time:?}");
        for (close, near) in [stereo, time] {
            assert!(close > 0.75 && near > 0.95, "{name}: stereo {stereo:?}, time {time:?}");
        }
    }
}

#[test]
fn every_patch_has_texture_to_match() {
    // The standard deviation within 9 × 9 pixels, against about 2 levels of sensor noise.
    for (name, frame) in [("C", 0), ("demo", 0), ("demo", 23)] {
        let sequence = Sequence::named(name, None, None, 1.0).unwrap();
        let image = sequence.view(frame).unwrap().render(2).left;
        let mut sigmas = Vec::new();
        for v in (4..image.height() - 4).step_by(4) {
            for u in (4..image.width() - 4).step_by(4) {
                let patch = (0..81).map(|i| f64::from(image.at(u - 4 + i % 9, v - 4 + i / 9)));
                let (sum, squares) = patch.fold((0.0, 0.0), |(s, q), g| (s + g, q + g * g));
                sigmas.push((squares / 81.0 - (sum / 81.0_f64).powi(2)).sqrt());
            }
        }
        sigmas.sort_by(f64::total_cmp);
        let (weakest, percent) = (sigmas[0], sigmas[sigmas.len() / 100]);
        println!("{name} {frame}: weakest patch {weakest:.2}, 1 % below {percent:.2}");
        assert!(weakest > 2.0 && percent > 4.0, "{name} {frame}: {weakest} {percent}");
    }
}

#[test]
fn structure_is_exact_at_any_pose() {
    // Each surface of the room by its own closed form, in the world, from poses turned about two axes.
    let sequence = Sequence::named("C", None, Some(4), 8.0).unwrap();
    let centre = Vector3::new(-0.35, 0.30, 2.1);
    let mut seen = [0; 6];
    for (k, (u, v)) in (0..4).flat_map(|k| pixels().map(move |pixel| (k, pixel))) {
        let world_from_left = sequence.world_from_left(k).unwrap();
        let point = sequence.view(k).unwrap().truth_at(u, v).unwrap();
        let p = world_from_left.apply(&point.point);
        let part = usize::from(point.surface / 6);
        seen[part] += 1;
        let off = match part {
            0 => p.y - 0.9,
            1 => p.z - 6.0,
            2 => p.x + 1.7,
            3 => p.x - 1.7,
            4 => (p - centre).norm() - 0.4,
            _ => sequence.scene.parts()[5].shape.clearance_m(&p),
        };
        assert!(off.abs() < 1e-12, "{k} {u} {v} part {part}: {off}");
        let (x, y) = sequence.rig.image_from_pixel(u, v);
        assert!((point.point.x / point.depth_m() - x / sequence.rig.focal_px).abs() < 1e-14);
        assert!((point.point.y / point.depth_m() - y / sequence.rig.focal_px).abs() < 1e-14);
    }
    assert!(seen.iter().all(|&n| n > 3), "{seen:?}");
}

#[test]
fn right_visibility_is_a_cast_from_the_right_camera() {
    // The right camera is the left one of the same rig moved by its baseline.
    let sequence = Sequence::named("drive", None, Some(4), 2.0).unwrap();
    let (view, rig) = (sequence.view(3).unwrap(), &sequence.rig);
    let mut right = view;
    right.world_from_cyclopean.translation +=
        view.world_from_cyclopean.rotation * Vector3::new(rig.baseline_m, 0.0, 0.0);
    let (truth, mut seen, mut hidden) = (view.truth(), 0, 0);
    for v in 0..rig.height_px {
        for u in 0..rig.width_px {
            let point = truth.at(u, v).unwrap();
            let u_right = u as f64 - point.disparity_px();
            if u_right < 0.0 {
                assert!(!point.in_right);
                continue;
            }
            // What the right camera sees there is the point, or something nearer.
            let nearer = point.depth_m() - right.truth_at(u_right, v as f64).unwrap().depth_m();
            assert!(nearer > -1e-5 * point.depth_m(), "{u} {v} {nearer}");
            assert_eq!(point.in_right, nearer < 1e-5 * point.depth_m(), "{u} {v} {nearer}");
            seen += usize::from(point.in_right);
            hidden += usize::from(!point.in_right);
        }
    }
    assert!(hidden > 500 && seen > 50_000, "{hidden} {seen}");
}

#[test]
fn truth_maps_are_the_truth_of_every_pixel() {
    // Other principal points and pixels that are not square.
    let mut sequence = Sequence::named("drive", Some((160, 120)), Some(2), 4.0).unwrap();
    (sequence.rig.doffs_px, sequence.rig.focal_y_px) = (3.5, 190.0);
    let (view, next) = (sequence.view(0).unwrap(), sequence.view(1).unwrap());
    let phi = sequence.phi(0).unwrap();
    let (maps, truth) = (view.truth_maps(Some(&phi)), view.truth());
    let mut followed = 0;
    for v in 0..120 {
        for u in 0..160 {
            let point = truth.at(u, v).unwrap();
            let motion = view.motion_at(&point, &phi);
            let get = |field: &egomotion::geometry::Field| f64::from(field.get(u, v).unwrap());
            assert!((get(&maps.depth) - point.depth_m()).abs() < 1e-6 * point.depth_m());
            assert!((get(&maps.shift) + 3.5 - point.disparity_px()).abs() < 1e-5);
            assert!((get(&maps.depth_velocity) - motion.depth_change_m(&point)).abs() < 1e-6);
            assert_eq!(maps.visible.at(u, v), u8::from(point.in_right) + 2 * u8::from(motion.in_later));
            if motion.in_later {
                // The later frame sees the same depth there; f32 holds the place to 1e-5 px.
                let (u, v) = (u as f64 + get(&maps.flow[0]), v as f64 + get(&maps.flow[1]));
                let there = next.truth_at(u, v).unwrap();
                followed += usize::from((there.depth_m() - motion.later.z).abs() < 1e-4);
            }
        }
    }
    let later = maps.visible.values().iter().filter(|&&bits| bits & 2 != 0).count();
    assert!(followed > later - 20 && later > 15_000, "{followed} of {later}");
    let last = view.truth_maps(None);
    assert_eq!((last.depth, last.shift), (maps.depth, maps.shift));
    assert_eq!(last.depth_velocity.count() + last.flow[0].count() + last.flow[1].count(), 0);
    assert!(last.visible.values().iter().all(|&bits| bits < 2));
}

#[test]
fn another_texture_is_another_picture_of_the_same_room() {
    let plain = Sequence::named("C", Some((80, 60)), None, 1.0).unwrap();
    let other = plain.clone().with_texture(7);
    let [a, b] = [&plain, &other].map(|s| s.view(0).unwrap().render(1).left);
    let differ = a.values().iter().zip(b.values()).filter(|(a, b)| (*a - *b).abs() > 3.0).count();
    assert!(differ > 80 * 60 / 2, "{differ}");
    assert_eq!(plain.view(0).unwrap().truth(), other.view(0).unwrap().truth());
    assert_eq!(plain.clone().with_texture(plain.scene.texture().seed()), plain);
}

#[test]
fn a_pose_that_is_no_number_is_not_clear_of_anything() {
    let far = Sequence::named("C", None, Some(3), 1e308).unwrap();
    assert!(far.clearance_m(0).unwrap() > 0.0);
    assert!((1..3).all(|k| far.clearance_m(k).is_some_and(|c| c.is_nan() || c < 0.0)));
}
