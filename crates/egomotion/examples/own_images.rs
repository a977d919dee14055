//! Images from memory: a camera driver's bytes in, the motion and the depth velocity of a pixel out.
//!
//! `cargo run --release -p egomotion --example own_images`

use egomotion::geometry::Image;
use egomotion::pipeline::{Config, StereoFrame, StereoMotion};
use egomotion::sim::{SensorNoise, Sequence};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Stands in for a camera: a rendered drive, whose motion is known exactly.
    let camera = Sequence::named("drive", Some((320, 240)), Some(4), 1.0).ok_or("no such sequence")?;
    let mut motion = StereoMotion::new(camera.rig, Config::default())?;
    for k in 0..camera.frames() {
        let view = camera.view(k).ok_or("no such frame")?;
        let images = SensorNoise::default().expose(&view.render(2), k as u64);
        let [left, right] = [&images.left, &images.right].map(bytes_of_the_camera);
        let frame = StereoFrame {
            time_s: 0.1 * k as f64,
            left: image(camera.rig.width_px, camera.rig.height_px, &left)?,
            right: image(camera.rig.width_px, camera.rig.height_px, &right)?,
        };
        let answer = motion.push(frame);
        match &answer.motion {
            Err(why) => println!("frame {k}: no motion, {why}"),
            Ok(estimate) => {
                let truth = camera.phi(k - 1).ok_or("no truth")?.vector();
                println!("frame {k}: φ in m and rad");
                for (i, name) in ["tX", "tY", "tZ", "ΩX", "ΩY", "ΩZ"].iter().enumerate() {
                    let (value, sigma) = (estimate.theta.mean[i], estimate.theta.sigma(i));
                    println!("  {name} {value:9.6} ± {sigma:.6}, true {:9.6}", truth[i]);
                    assert!((value - truth[i]).abs() < 6.0 * sigma, "{name} is off by more than 6σ");
                }
            }
        }
        let Some(maps) = answer.dense.map(|dense| dense.motion) else { continue };
        let middle = maps.depth_velocity.get(160, 120).zip(maps.depth_velocity_sigma.get(160, 120));
        if let Some((vz, sigma)) = middle {
            println!("  depth velocity in the middle of the image: {vz:.4} ± {sigma:.4} m a frame");
        }
    }
    Ok(())
}

/// Grey levels 0 … 255, row by row, become an image.
fn image(width: usize, height: usize, bytes: &[u8]) -> Result<Image, &'static str> {
    let grey = bytes.iter().map(|&byte| f32::from(byte)).collect();
    Image::from_values(width, height, grey).ok_or("the camera gave too few bytes")
}

/// What a driver would hand over.
fn bytes_of_the_camera(image: &Image) -> Vec<u8> {
    image.values().iter().map(|grey| grey.round() as u8).collect()
}
