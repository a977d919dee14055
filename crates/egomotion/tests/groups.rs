//! What moves by itself in rendered pairs: nothing in a static scene, and a body where there is one.

use egomotion::geometry::{RigidMotion, StereoRig, Twist};
use egomotion::pipeline::{Config, FrameMotion, StereoFrame, StereoMotion};
use egomotion::sim::{Part, Scene, SensorNoise, Sequence, Shape, View, twist_from_mm_deg};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn sequence(name: &str) -> Sequence {
    Sequence::named(name, Some((320, 240)), Some(2), 1.0).unwrap()
}

/// A pose within `metres` and `degrees` of the world's origin along and about each axis.
fn near(rng: &mut Pcg64Mcg, metres: f64, degrees: f64) -> RigidMotion {
    let mut within = |reach: f64| Vector3::from_fn(|_, _| rng.random_range(-reach..=reach));
    Twist { t: within(metres), omega: within(degrees.to_radians()) }.exp()
}

fn second(rig: StereoRig, frames: [StereoFrame; 2]) -> FrameMotion {
    let mut motion = StereoMotion::new(rig, Config::default()).unwrap();
    let [first, second] = frames;
    motion.push(first);
    motion.push(second)
}

#[test]
fn nothing_moves_by_itself_in_static_scenes() {
    const PAIRS: usize = 7;
    let (mut pairs, mut with_groups) = (0, 0);
    for name in ["A", "C", "drive"] {
        let sequence = sequence(name);
        let phi = sequence.phi_cyclopean(0).unwrap();
        for number in 0..PAIRS {
            let mut rng = Pcg64Mcg::seed_from_u64(1000 + number as u64);
            let scene = sequence.scene.clone().with_texture(rng.random());
            let pose = near(&mut rng, 0.15, 5.0);
            let poses = [pose, pose.after(&phi.exp().inverse())];
            let noise = SensorNoise::default().with_seed(number as u64);
            let frames = [0, 1].map(|k| {
                let view = View::new(&scene, &sequence.rig, poses[k]);
                let seen = noise.expose(&view.render(3), k as u64);
                StereoFrame { time_s: k as f64, left: seen.left, right: seen.right }
            });
            let answer = second(sequence.rig, frames);
            pairs += 1;
            with_groups += usize::from(!answer.moving.is_empty());
            for group in &answer.moving {
                println!("{name} {number} {group:?}");
            }
        }
    }
    // Larger images of a room full of depth edges.
    let drive = Sequence::named("demo", Some((640, 480)), None, 1.0).unwrap();
    let noise = SensorNoise::default().with_seed(5);
    for k in (0..drive.frames() - 1).step_by(3) {
        let frames = [k, k + 1].map(|k| {
            let seen = noise.expose(&drive.view(k).unwrap().render(3), k as u64);
            StereoFrame { time_s: drive.interval_s * k as f64, left: seen.left, right: seen.right }
        });
        let answer = second(drive.rig, frames);
        pairs += 1;
        with_groups += usize::from(!answer.moving.is_empty());
        for group in &answer.moving {
            println!("demo {k} {group:?}");
        }
    }
    println!("{with_groups} of {pairs}");
    assert!(with_groups * 20 <= pairs, "{with_groups} of {pairs}");
}

/// Depth of the room and of a body of its own, each from its own pose, put together: one frame.
struct Composite<'a> {
    rig: &'a StereoRig,
    room: &'a Scene,
    body: &'a Scene,
}

impl Composite<'_> {
    /// What the cyclopean camera at these two poses sees of the room and of the body, and the body's share of the
    /// left image.
    fn frame(
        &self,
        room: &RigidMotion,
        body: &RigidMotion,
        noise: &SensorNoise,
        k: u64,
    ) -> (StereoFrame, f64) {
        let views = [View::new(self.room, self.rig, *room), View::new(self.body, self.rig, *body)];
        let mut images = views[0].render(3);
        let over = views[1].render(1);
        let (width, height) = (self.rig.width_px, self.rig.height_px);
        let mut covered = 0;
        for (side, image, over) in
            [(0.0, &mut images.left, &over.left), (1.0, &mut images.right, &over.right)]
        {
            // The right image is the left one of a rig that stands a baseline further to the right.
            let aside = RigidMotion {
                rotation: Matrix3::identity(),
                translation: Vector3::new(side * self.rig.baseline_m, 0.0, 0.0),
            };
            let shifted = [(self.room, room), (self.body, body)]
                .map(|(scene, pose)| View::new(scene, self.rig, pose.after(&aside)));
            for (u, v) in (0..height).flat_map(|v| (0..width).map(move |u| (u, v))) {
                let [behind, before] = shifted
                    .each_ref()
                    .map(|view| view.structure_at(u as f64, v as f64).map_or(0.0, |s| s.0.z));
                if before > behind {
                    image.set(u, v, over.at(u, v));
                    covered += usize::from(side == 0.0);
                }
            }
        }
        let seen = noise.expose(&images, k);
        let frame = StereoFrame { time_s: k as f64, left: seen.left, right: seen.right };
        (frame, covered as f64 / (width * height) as f64)
    }
}

/// Motions of the room and of the body, as seen by the cyclopean camera.
const ROOM_MM_DEG: [f64; 6] = [10.0, -10.0, -15.0, 0.1, 0.1, 0.0];
const BODY_MM_DEG: [f64; 6] = [25.0, 5.0, -40.0, 0.2, 0.6, 0.0];

/// NEES/6 of φ of eight pairs, and by how many σ VZ of the body is off; `foreseen` after frames without the body.
fn captured(half_width_m: f64, share: std::ops::Range<f64>, foreseen: bool) -> (Vec<f64>, Vec<Option<f64>>) {
    let sequence = sequence("C");
    let left = sequence.rig.left_from_cyclopean();
    let [of_room, of_body] = [ROOM_MM_DEG, BODY_MM_DEG].map(|motion| twist_from_mm_deg(&motion));
    let (mut nees, mut sigmas) = (Vec::new(), Vec::new());
    for number in 0..8 {
        let mut rng = Pcg64Mcg::seed_from_u64(77 + number);
        let room = sequence.scene.clone().with_texture(rng.random());
        let shape = Shape::turned_box([0.05, 0.0, 1.45], [half_width_m, 0.75 * half_width_m, 0.15], 20.0);
        let parts = vec![Part { shape, grey: 130.0, tile_m: 0.0 }];
        let body = Scene::new(parts, room.lamp_m(), room.contrast(), rng.random());
        let pose = near(&mut rng, 0.05, 3.0);
        let composite = Composite { rig: &sequence.rig, room: &room, body: &body };
        let noise = SensorNoise::default().with_seed(number);
        let (first, covered) = composite.frame(&pose, &RigidMotion::identity(), &noise, 0);
        assert!(share.contains(&covered), "the body covers {covered}");
        let [room_to, body_to] = [of_room, of_body].map(|phi| phi.exp().inverse());
        let (next, _) = composite.frame(&pose.after(&room_to), &body_to, &noise, 1);
        let mut pipeline = StereoMotion::new(sequence.rig, Config::default()).unwrap();
        if foreseen {
            // Before, the room was alone in the image and moved as it does.
            let before = pose.after(&of_room.exp());
            for (k, pose) in [before.after(&of_room.exp()), before].iter().enumerate() {
                let seen = noise.expose(&View::new(&room, &sequence.rig, *pose).render(3), 2 + k as u64);
                pipeline.push(StereoFrame { time_s: k as f64 - 2.0, left: seen.left, right: seen.right });
            }
        }
        pipeline.push(first);
        let answer = pipeline.push(next);
        let motion = answer.motion.as_ref().unwrap();
        let truth = of_room.seen_from(&left);
        let square = motion.theta.mahalanobis2(&truth.vector()).unwrap();
        let found = answer.moving.first().map(|group| {
            let (u, v) = group.centre_px;
            let (x, y) = sequence.rig.image_from_pixel(u, v);
            let p = sequence
                .rig
                .point(&Vector3::new(x, y, sequence.rig.disparity(group.depth_m).unwrap()))
                .unwrap();
            let vz = of_body.seen_from(&left).exp().apply(&p).z - p.z;
            (group.depth_velocity.value() - vz) / group.depth_velocity.sigma(0)
        });
        println!(
            "{covered:.2} covered: NEES/6 {:.2}, VZ off by {found:.2?} sigma, {} groups",
            square / 6.0,
            answer.moving.len()
        );
        nees.push(square / 6.0);
        sigmas.push(found);
    }
    (nees, sigmas)
}

/// φ within its covariance, and the body found with its VZ within 3σ in all pairs but one at most.
fn assert_apart(half_width_m: f64, share: std::ops::Range<f64>, foreseen: bool) {
    let (nees, sigmas) = captured(half_width_m, share.clone(), foreseen);
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    let found = sigmas.iter().filter(|s| s.is_some_and(|s| s.abs() < 3.0)).count();
    println!("{share:?}: NEES/6 {mean:.2}, {found} found");
    assert!(mean < 2.0, "{share:?}: {nees:?}");
    assert!(found + 1 >= sigmas.len(), "{share:?}: {sigmas:?}");
}

#[test]
fn a_body_does_not_capture_the_motion() {
    assert_apart(0.185, 0.13..0.17, false);
    assert_apart(0.27, 0.28..0.33, false);
}

/// At this size the textured body holds more than half of the tracks. Of a single pair nobody can know then which
/// of the two moves, and the body's motion is taken for the scene's; after frames without it the scene's goes on.
#[test]
fn a_body_that_holds_most_tracks_does_not_capture_a_motion_that_goes_on() {
    assert_apart(0.335, 0.42..0.48, true);
}
