//! Tracks of your own: a tracker's points in the left and the right image, frame by frame, give the motion.
//!
//! `cargo run --release -p egomotion --example own_tracks`

use egomotion::geometry::{StereoRig, Twist};
use egomotion::pipeline::{Config, TrackMotion, TrackPoint};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rig = StereoRig::new(700.0, (319.5, 239.5), 0.2, (640, 480))?;
    // In each frame the scene comes 0.1 m nearer and turns by 0.3° about the vertical axis.
    let phi = Twist { t: Vector3::new(0.0, 0.0, -0.1), omega: Vector3::new(0.0, 0.3_f64.to_radians(), 0.0) };
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let mut points: Vec<Vector3<f64>> = (0..300)
        .map(|_| {
            let z = random.random_range(5.0..20.0);
            Vector3::new(random.random_range(-0.4..0.4) * z, random.random_range(-0.3..0.3) * z, z)
        })
        .collect();

    let mut motion = TrackMotion::new(rig, Config::default())?;
    for k in 0..4 {
        // What a tracker gives: the number of each point, and where both images show it, here wrong by up to 0.3 px.
        let mut noisy = |place: f64| place + random.random_range(-0.3..0.3);
        let seen = points.iter().enumerate().filter_map(|(number, point)| {
            let xyd = rig.project(point)?;
            let (u, v) = rig.pixel_from_image(xyd.x, xyd.y);
            let (left, right) = ((noisy(u), noisy(v)), (noisy(u - xyd.z), noisy(v)));
            Some(TrackPoint { track: number as u64, left, right })
        });
        let tracks: Vec<TrackPoint> = seen.collect();
        let answer = motion.push(0.1 * f64::from(k), &tracks);
        match &answer.motion {
            Err(why) => println!("frame {k}: no motion, {why}"),
            Ok(estimate) => {
                let (tz, sigma) = (estimate.theta.mean[2], estimate.theta.sigma(2));
                let (used, truth) = (estimate.inliers, phi.t.z);
                println!("frame {k}: tZ {tz:.4} ± {sigma:.4} m, true {truth:.4} m, from {used} tracks");
                assert!((tz - truth).abs() < 6.0 * sigma);
            }
        }
        points.iter_mut().for_each(|point| *point = phi.exp().apply(point));
    }
    Ok(())
}
