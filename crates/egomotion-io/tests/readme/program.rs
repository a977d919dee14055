use egomotion::pipeline::{Config, StereoFrame, StereoMotion};
use egomotion_io::{Source, image};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let source = Source::open("my-recording".as_ref())?;
    let recording = &source.sequences[0];
    let mut motion = StereoMotion::new(recording.rig.ok_or("no calibration")?, Config::default())?;
    for frame in &recording.frames {
        let (left, right) = (image::read(&frame.left)?, image::read(frame.right.as_ref().ok_or("no right image")?)?);
        let answer = motion.push(StereoFrame { time_s: frame.time_s, left, right });
        let Ok(estimate) = &answer.motion else { continue };
        let (nearer, sigma) = (-estimate.theta.mean[2], estimate.theta.sigma(2));
        let impact = answer.impact().and_then(|impact| impact.interval95_s());
        println!("the scene came {nearer:.4} ± {sigma:.4} m nearer; impact in {impact:?} s");
    }
    Ok(())
}
