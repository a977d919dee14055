//! What moves by itself in rendered pairs: nothing in a static scene, and a body where there is one.

use egomotion::geometry::{RigidMotion, StereoRig, Twist};
use egomotion::pipeline::{Config, FrameMotion, StereoFrame, StereoMotion};
use egomotion::sim::{SensorNoise, Sequence};
use nalgebra::Vector3;
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
                let view = egomotion::sim::View::new(&scene, &sequence.rig, poses[k]);
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
    println!("{with_groups} of {pairs}");
    assert!(with_groups * 20 <= pairs, "{with_groups} of {pairs}");
}
