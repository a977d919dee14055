//! Time to impact from a live source: frames with time stamps come one by one, and each is answered at once.
//!
//! `cargo run --release -p egomotion --example live_impact`

use egomotion::pipeline::{Config, Observe, StereoFrame, StereoMotion};
use egomotion::sim::{SensorNoise, Sequence};

/// The vehicle brakes when it may hit something within this time.
const BRAKE_S: f64 = 2.4;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let vehicle = Sequence::named("lab-I", None, Some(6), 1.0).ok_or("no such sequence")?;
    // Tracked corners alone answer fastest. What crosses the vehicle's window, in metres around the camera's axis, is an
    // obstacle.
    let mut config = Config { observe: Observe::Sparse, ..Config::default() };
    (config.vehicle.left_m, config.vehicle.right_m) = (-0.4, 0.4);
    let mut motion = StereoMotion::new(vehicle.rig, config)?;
    let mut brakes = false;
    for frame in live(&vehicle) {
        let answer = motion.push(frame);
        match &answer.obstacle {
            Err(why) => println!("{:.1} s: no obstacle, {why}", answer.time_s),
            Ok(obstacle) => {
                let Some((lo, hi)) = obstacle.impact.interval95_s() else { continue };
                // The near end of the interval counts: a wide interval is a reason to brake early.
                brakes |= lo < BRAKE_S;
                let action = if brakes { ": brake!" } else { "" };
                println!("{:.1} s: impact in {lo:.2} to {hi:.2} s, 95 %{action}", answer.time_s);
            }
        }
    }
    assert!(brakes, "the vehicle drives towards a wall one metre ahead");
    Ok(())
}

/// Stands in for a camera: rendered pairs of a vehicle that drives 0.4 m in a second, ten frames a second.
fn live(vehicle: &Sequence) -> impl Iterator<Item = StereoFrame> + '_ {
    (0..vehicle.frames()).filter_map(|k| {
        let images = SensorNoise::default().expose(&vehicle.view(k)?.render(2), k as u64);
        Some(StereoFrame { time_s: 0.1 * k as f64, left: images.left, right: images.right })
    })
}
