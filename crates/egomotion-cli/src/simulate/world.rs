//! What is to be rendered: a named motion, in its own scene or that of a file, seen by a sensor.

use anyhow::{Result, anyhow};
use egomotion::geometry::StereoRig;
use egomotion::sim::{Scene, SensorNoise, Sequence};
use serde::{Deserialize, Serialize};

use crate::args::{NoiseArg, SimulateArgs};
use crate::terminal::tell;
use crate::{Usage, toml_file};

/// Rays along each side of a pixel that shows an edge.
const SAMPLES: usize = 3;

/// A sequence to be rendered.
pub struct World {
    pub sequence: Sequence,
    pub sensor: SensorNoise,
    /// Number of frames: those in which the cameras stay clear of everything.
    pub frames: usize,
    /// Factor of every motion of the named sequence.
    pub step: f64,
}

/// `scene.toml`: where the sequence takes place, and what sees it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Without one, the sequence's own.
    pub rig: Option<StereoRig>,
    /// Without one, what the options say.
    pub sensor: Option<SensorNoise>,
    pub scene: Scene,
}

impl World {
    /// What the options ask for.
    pub fn of(args: &SimulateArgs) -> Result<Self> {
        let known = || Sequence::names().collect::<Vec<_>>().join(", ");
        if !Sequence::names().any(|name| name.eq_ignore_ascii_case(&args.sequence)) {
            let name = &args.sequence;
            return Err(
                Usage(format!("--sequence {name:?}: there is no such sequence; known: {}", known())).into()
            );
        }
        let asked = args.frames.map(|frames| frames as usize);
        let mut sequence = Sequence::named(&args.sequence, args.size, asked, args.step)
            .ok_or_else(|| Usage("--size: an image has at least one pixel".into()))?;
        let mut sensor = None;
        if let Some(path) = &args.scene {
            let file: SceneFile = toml_file::read(path)?;
            let wrong = |what: String| anyhow!("{}: {what}", path.display());
            sequence.scene = file.scene;
            if let Some(rig) = file.rig {
                rig.check().map_err(|e| wrong(format!("rig: {e}")))?;
                check_size((rig.width_px, rig.height_px)).map_err(|e| wrong(format!("rig: the size {e}")))?;
                if args.size.is_some() {
                    let reason =
                        format!("--size: {} has a rig of its own; leave out one of them", path.display());
                    return Err(Usage(reason).into());
                }
                sequence.rig = rig;
            }
            if let Some(read) = &file.sensor {
                read.check().map_err(|e| wrong(format!("sensor: {e}")))?;
            }
            sensor = file.sensor;
        }
        if let Some(seed) = args.texture {
            sequence = sequence.with_texture(seed);
        }
        let sensor = match args.noise {
            Some(NoiseArg::Sensor) => SensorNoise::default(),
            // The files hold 8 bits.
            Some(NoiseArg::None) => SensorNoise { eight_bit: true, ..SensorNoise::none() },
            None => sensor.unwrap_or_default(),
        };
        let sensor = args.seed.map_or(sensor, |seed| sensor.with_seed(seed));
        let frames = clear_frames(&sequence, asked)?;
        Ok(Self { sequence, sensor, frames, step: args.step })
    }

    /// Both images of frame `k` as the sensor delivers them; `None` past the end.
    pub fn photograph(&self, k: usize) -> Option<egomotion::sim::StereoImages> {
        Some(self.sensor.photograph(&self.sequence.view(k)?, SAMPLES, k as u64))
    }

    /// The sensor for people.
    pub fn noise_in_words(&self) -> String {
        let none = SensorNoise { eight_bit: true, ..SensorNoise::none() };
        if self.sensor == none.with_seed(self.sensor.seed) {
            "no noise".into()
        } else {
            format!("sensor noise of seed {}", self.sensor.seed)
        }
    }
}

/// Number of frames until a camera would touch something; says so if that is before the end.
fn clear_frames(sequence: &Sequence, asked: Option<usize>) -> Result<usize> {
    let (name, frames) = (&sequence.name, sequence.frames());
    if let Some(asked) = asked.filter(|&asked| asked > frames) {
        tell(format_args!("{name} has {frames} frames, not {asked}"));
    }
    let blocked = |k: &usize| !sequence.clearance_m(*k).is_some_and(|clearance| clearance > 0.0);
    match (0..frames).find(blocked) {
        None => Ok(frames),
        // Every sequence starts at the world's origin.
        Some(0) => Err(anyhow!(
            "frame 0 of {name}: a camera is outside the room or inside a part; leave the scene's origin clear"
        )),
        Some(1) => Err(Usage(format!(
            "frame 1 of {name}: a camera would leave the room or enter a part of the scene; take a smaller --step"
        ))
        .into()),
        Some(k) => {
            tell(format_args!(
                "frame {k} of {name}: a camera would leave the room or enter a part of the scene; \
                 the sequence ends with frame {}",
                k - 1
            ));
            Ok(k)
        }
    }
}

/// Pixels of the largest image that is rendered, 2²⁵: 8K is one.
const MAX_PIXELS: usize = 1 << 25;

/// Whether images of this size can be rendered and kept.
pub fn check_size((width, height): (usize, usize)) -> Result<(), String> {
    let pixels = width.saturating_mul(height);
    match pixels {
        0 => Err("has no pixels".into()),
        _ if pixels > MAX_PIXELS => Err(format!("{width}x{height} is more than {MAX_PIXELS} pixels")),
        _ => Ok(()),
    }
}
