//! Disparity alone, with its σ: one pair of images in, the depth of pixels out.
//!
//! `cargo run --release -p egomotion --example disparity`

use egomotion::observe::{DisparityMatcher, DisparityOptions};
use egomotion::sim::{SensorNoise, Sequence};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Stands in for a camera: a rendered pair, whose disparity is known exactly.
    let room = Sequence::named("C", Some((320, 240)), Some(2), 1.0).ok_or("no such sequence")?;
    let view = room.view(0).ok_or("no such frame")?;
    let images = SensorNoise::default().expose(&view.render(2), 0);

    // The nearest surface of this room has a disparity below 64 px. A matcher keeps its work space: make it once.
    let mut matcher = DisparityMatcher::new(DisparityOptions { levels: 64, ..Default::default() });
    let map = matcher.compute(&images.left, &images.right)?;

    println!("    u    v   disparity (px)     true   depth (m)");
    let (mut answered, mut within) = (0, 0);
    for (u, v) in (20..230).step_by(10).flat_map(|v| (40..310).step_by(10).map(move |u| (u, v))) {
        let (Some(d), Some(sigma)) = (map.shift.get(u, v), map.sigma.get(u, v)) else { continue };
        let truth = view.truth_at(u as f64, v as f64).ok_or("the room is closed")?.disparity_px();
        let (d, sigma) = (f64::from(d), f64::from(sigma));
        answered += 1;
        within += usize::from((d - truth).abs() < 3.0 * sigma);
        if (u, v) == (40, 120) || (u, v) == (160, 120) || (u, v) == (280, 120) {
            // Z = b f / d, and σ of Z by the derivative of that.
            let depth = room.rig.depth_disparity_product() / d;
            println!(
                "  {u:3}  {v:3}   {d:6.2} ± {sigma:.2}   {truth:6.2}   {depth:.3} ± {:.3}",
                depth * sigma / d
            );
        }
    }
    println!("{within} of {answered} pixels lie within 3σ of the truth");
    assert!(answered > 400 && within * 10 > answered * 9);
    Ok(())
}
